"""Work at the same time, in threads or in copies of the process: items in, what a function finds of each out.

Results depend neither on how many work at once nor on where.
"""
