"""Sticks whose markers are no dots: a tag on a stick, or texture around two of its points.

In: frames, and what :class:`tracker.hints.MarkerHints` tell of each stick. Out: the two markers of each stick in every
frame, as rows of :mod:`tracker.rows`. ``align`` is Lucas–Kanade against a fixed template, ``track`` follows one
template from frame to frame, ``tags`` and ``texture`` make templates and find them again, ``tag_stick``,
``texture_stick`` and ``dots`` judge a stick as a whole, ``follow`` goes through the film, ``begin`` starts it.
"""
