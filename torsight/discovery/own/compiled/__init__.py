"""Models of one's own as machine code.

A function or a right-hand side in plain Python in, the same compiled by numba out, where it gives the same.
"""
