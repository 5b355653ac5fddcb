"""Models of one's own as machine code.

In: a function or a right-hand side in plain Python. Out: the same compiled by numba, where its results agree.
"""
