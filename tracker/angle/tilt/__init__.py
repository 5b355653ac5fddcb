"""Tilt of the plane of motion, without a camera file, and the read-out time of a rolling shutter, from markers' paths.

In: positions of the moving stick's markers from the picture's middle, y up, in units of half the picture's width, with
covariances, and the instants (s) at which each is read. Out: a :class:`~tracker.angle.tilt.models.Tilt` (values without
a unit, with their covariance; the standard deviation of the angle in rad). ``paths`` maps the picture to the plane of
motion and computes the markers' residuals from their circles, ``estimate`` fits models to these, and ``models``
averages the models over their evidence, and decides what is corrected.

The moving markers go around circles, and the picture shows ellipses. The mapping of a plane seen obliquely to the
picture is a homography. The image of two circles about one centre determines it up to a rotation and a scale, which do
not change angles; parallel planes share it, so it holds for the base stick's directions, too. The fit estimates a
stretch (e1, e2), ψ²/4 for a tilt ψ, the perspective (l1, l2), and the lens's radial distortion k, with the circles'
centre, radii, and the angle between both markers.

The camera's tilt is not known beforehand, so a prior of a small tilt and one of a large tilt compete, weighted by their
evidence (Laplace's approximation). The paths' errors are correlated over many frames (see
:mod:`torsight.core.optics.hanging`): over a short arc they look like an ellipse, and the covariance includes that.

Only a tilt that the motion determines is corrected: one that is no larger than its uncertainty is left uncorrected,
and added to the covariance. A stick that hardly turns determines no tilt: its markers' noise alone has a shape.

A rolling shutter (:mod:`tracker.angle.row_time`) is fitted in addition: read-out along x, read-out along y, and a
global shutter are three models, weighted by their evidence as well, against any other effect that depends on speed and
position and would look like a read-out longer than a frame. The lag by a codec, or by a camera that averages noise over
frames, is also fitted: both repeat the last picture as long as a pixel changes little, so that a marker lags behind,
the more the faster it moves until its pixels change much, and the angle between both markers differs between the two
senses of rotation, wherever the markers are in the picture. The dependence of the lag on the speed is free, and the
evidence decides whether the lag is that of a codec alone. Motion blur changes the angle between the markers with the
speed, equally for both senses: the position found for a blurred marker, a bent tag most of all, lies a little beside
the middle of its path. Such errors lie along the circles, where the stick's length does not show them: residuals across
the arms, including the lag, beyond those along the arms count in the angle's uncertainty.
"""
