"""The next experiment.

In: explanations that one record cannot distinguish. Out: a temperature programme (s, °C) that can.
"""
