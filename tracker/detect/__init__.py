"""Detection of markers in one picture, without prior knowledge of their positions.

In: a picture (h, w) uint8, or a marker file. Out: dots with their shape in px (``dots``), the two sticks that they lie
on (``sticks``, and ``pairs`` for many dots), dots at given positions (``given_positions``), candidates with the reason
why each was rejected (``candidates``), what moves (``moving_part``), tags (``fiducials``), and the
user's entries on the markers (``marker_file``).
"""
