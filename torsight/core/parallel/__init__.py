"""Parallel work in threads or in copies of the process: a function is applied to each item of a list.

Results depend neither on the number of workers nor on their kind.
"""
