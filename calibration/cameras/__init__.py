"""Measured corners to lenses: one camera, and where a second one stands against it.

In: views (px, mm). Out: intrinsics (px) with standard deviations, views that were set aside and why, rotation (rad) and
translation (mm) of the right camera from the left.
"""
