"""Calibration boards and tags: the content of ``BOARD.toml``, the corners' positions, and pages to print.

In: a table of keys (mm). Out: a :class:`~calibration.boards.board_file.Board` with its corners (mm from its middle,
x right, y down), and drawings in true scale as SVG, PDF or picture.
"""
