"""The part of a scene that makes its pictures small and quick to draw, with dots of the usual size in them."""

SMALL_PICTURE = """
[camera]
width_px = 320
height_px = 240
focal_px = 550.0
[sticks]
dot_mm = 2.4
[light]
read_noise = 0.7
"""
