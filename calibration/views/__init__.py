"""Pictures and films to measured corners of the board.

In: picture files, films, folders or globs, and a board. Out: one :class:`~calibration.views.detect.View` for each
picture that shows the board: which corners, where (px, pixel centres at whole numbers), measured in two windows.
"""
