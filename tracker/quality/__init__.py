"""Assessment of a track: its quality, the events in it, and advice for the next film.

In: :class:`tracker.track.TrackResult` and the angles. Out: ``track.json`` (``account``), events in the order of time
(``events``), warnings that have to be read before the angles are used (``track_warnings``), and the cause of every gap
(``gaps``, with ``gap_pictures`` and ``light``, which examine the frames themselves).
"""
