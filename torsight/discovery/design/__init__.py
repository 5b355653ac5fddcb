"""The next experiment.

From explanations that one record cannot distinguish to a temperature programme (s, °C) that can.
"""
