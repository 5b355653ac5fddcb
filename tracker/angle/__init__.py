"""From the markers of all frames to the angle between the sticks, with its uncertainty.

In: :class:`torsight.core.tracks.MarkerTracks`, px and px², and a camera where there is one. Out:
:class:`torsight.core.tracks.StickAngles`, rad, counter-clockwise as displayed. ``orient`` is one camera (``plane``, and
``tilt`` where its pose is not known), ``stereo`` and ``stereo_films`` are two; ``camera_motion`` takes the camera's
shift out, ``reference_direction`` averages the base, ``single_marker`` goes on with one marker, ``length_noise`` learns
errors from the sticks' lengths, ``unwrap`` counts whole turns.
"""
