"""Boards to cameras: lenses with uncertainty, stereo pairs, the pose of the rotation axis."""
