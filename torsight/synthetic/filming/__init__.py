"""A camera that films the rig.

In: the rig's angle over time (rad, s), a camera (px, mm). Out: frames (8-bit luma) with the times at which they were
taken, as a film or a folder of pictures.
"""
