"""The markers of a film for people: a page to pick them, a preview, and the picture of a track.

In: a film's frames and the tracker's results. Out: ``markers.toml``, ``track.png``, a preview.
"""
