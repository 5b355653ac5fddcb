"""Sticks whose markers are not dots: a tag on a stick, or texture around two of its points.

In: frames, and each stick's entries of :class:`tracker.detect.marker_file.MarkerHints`. Out: the two markers of each
stick in every frame, px and px², as rows of :mod:`tracker.rows`. ``align`` is Lucas–Kanade against a fixed template,
``exposure`` adds its motion blur, ``ink`` what else it lacks, ``patch_track`` follows it from frame to frame,
``tag_stick`` and ``texture_stick`` follow and check a whole stick, ``texture`` searches for one that was lost,
``initial_sticks`` creates the sticks.
"""
