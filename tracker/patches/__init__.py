"""Sticks whose markers are no dots: a tag on a stick, or texture around two of its points.

In: frames, and what :class:`tracker.detect.marker_file.MarkerHints` say of each stick. Out: the two markers of each
stick in every frame, px and px², as rows of :mod:`tracker.rows`. ``align`` is Lucas–Kanade against a fixed template,
``patch_track`` follows one template from frame to frame, ``tag_template`` and ``texture`` make templates,
``tag_stick`` and ``texture_stick`` judge a stick as a whole, ``initial_sticks`` makes them.
"""
