"""Models of one's own.

From a Python function, declared parameters and tables to a checked problem for the engine.
"""
