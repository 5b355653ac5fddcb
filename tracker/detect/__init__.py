"""Finding markers in one picture, without knowing where they are.

In: a picture (h, w) uint8, or a marker file. Out: dots with their shape in px (``dots``), the two sticks that they lie
on (``sticks``), dots at given positions (``given``), candidates with the reason why each was refused (``candidates``),
tags (``fiducials``), and what a person says of the markers (``marker_file``).
"""
