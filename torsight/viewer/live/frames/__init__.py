"""Frames as they arrive.

In: a film that plays, a camera by number, a stream, a film that still grows. Out: pictures (grey levels) with the times
(s) at which they were taken, in order, and the count of those that were lost.
"""
