"""From the marker positions of all frames to the angle between the sticks, with its uncertainty.

In: :class:`torsight.core.tracks.MarkerTracks`, px and px², and a camera where there is one. Out:
:class:`torsight.core.tracks.StickAngles`, rad, counter-clockwise as displayed. ``orient`` is for one camera (``plane``,
and ``tilt`` where its pose is not known), ``stereo`` and ``stereo_films`` for two; ``camera_motion`` removes the
camera's motion, ``reference_direction`` averages the base's direction, ``single_marker`` derives the direction from one
marker where the other is hidden, ``length_noise`` estimates position errors from the sticks' lengths, ``unwrap`` counts
whole turns.
"""
