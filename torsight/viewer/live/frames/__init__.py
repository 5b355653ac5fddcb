"""Frames as they arrive.

In: a playing film, a camera by number, a stream, a film that is still growing. Out: pictures (grey levels) with the
times (s) at which they were taken, in order, and the number of lost pictures.
"""
