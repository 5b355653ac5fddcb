"""The pose of the rotation axis in a calibrated camera.

In: pictures of the board on the disk (px), or the tracks of the moving stick's markers (px). Out: a
:class:`~torsight.core.optics.camera.Pose` (camera from world, mm; z along the axis, towards the camera) with the
standard deviation of its direction.
"""
