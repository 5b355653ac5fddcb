"""Sequential frames of a film or of pictures.

In: a file, a folder or a glob. Out: :class:`tracker.frames.frame.Frame`, with its time in s from the start, its luma
(h, w) uint8 as displayed, and whether it was decoded whole. ``source`` opens any of them; ``film_source``, ``decoder``
and ``display`` read films, ``image_sequence`` reads pictures; ``sample`` returns frames from chosen parts of a film,
``timing`` computes rate and regularity of the frames' times.
"""
