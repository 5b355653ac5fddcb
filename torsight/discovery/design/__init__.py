"""The next experiment.

Explanations that a record cannot tell apart in, a temperature programme (s, °C) that can out.
"""
