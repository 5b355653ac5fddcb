"""Fits to measured corners: the lens of one camera, and the pose of a second camera relative to the first.

In: views (px, mm). Out: intrinsics (px) with standard deviations, views that were set aside with reasons, rotation
(rad) and translation (mm) from the left to the right camera.
"""
