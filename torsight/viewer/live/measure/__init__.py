"""Measurement and computation while frames arrive.

In: pictures with times (s), a temperature log that grows. Out: marker positions (px), the angle of each frame (rad),
rows of the log (°C) with their times on the film's clock, and the model's angle from the record so far.
"""
