"""Angle and temperatures in one table.

In: angles on the film's clock, a log, the clock map between them. Out: one row per frame (s, rad, °C) with the log's
temperatures interpolated at the frame's instant, the content of ``sync.json``, and a warning where the durations
indicate a film in slow motion.
"""
