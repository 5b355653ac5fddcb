"""Models of one's own.

A Python function, parameters and tables as declared in, a checked problem for the engine out.
"""
