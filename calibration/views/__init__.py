"""Measurement of the board's corners in pictures and films.

In: picture files, films, folders or globs, and a board. Out: one :class:`~calibration.views.detect.View` for each
picture that shows the board: the corners' numbers and positions (px, pixel centres at whole numbers), measured in two
windows.
"""
