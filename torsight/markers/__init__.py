"""The markers of a film as a person sees them: a page to pick them, a preview, and the picture of a track.

In: a film's frames and what the tracker made of them. Out: ``markers.toml``, ``track.png``, a preview.
"""
