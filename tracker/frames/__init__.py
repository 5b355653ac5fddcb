"""Frames one after the other, from a film or from pictures.

In: a file, a folder or a glob. Out: :class:`tracker.frames.frame.Frame`, with its time in s from the start, its luma
(h, w) uint8 as displayed, and whether it was decoded whole. ``source`` opens any of them; ``film_source``, ``decoder``
and ``display`` are films, ``image_sequence`` pictures; ``sample`` gives frames from chosen places, ``timing`` says when
frames are shown.
"""
