"""What is said about a track: how good it is, what happened, and what would make the next film better.

In: :class:`tracker.track.TrackResult` and the angles. Out: ``track.json`` (``account``), events in the order of time
(``events``), sentences that have to be read before the angles are used (``track_warnings``), and the cause of every gap
(``gaps``, with ``gap_pictures``, which look at the frames themselves).
"""
