"""From measured corners to lenses: one camera, and the pose of a second one relative to it.

In: views (px, mm). Out: intrinsics (px) with standard deviations, views that were set aside and why, rotation (rad) and
translation (mm) of the right camera from the left.
"""
