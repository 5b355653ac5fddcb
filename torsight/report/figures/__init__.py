"""Figures of the report, each one function from a run's tables to panels.

In: the tables of a run in the units of its files (s, degrees, °C) and its JSON results. Out:
:class:`~torsight.report.figures.motion.Figure`, panels with their caption and their numbers; None where a table lacks
the columns of the figure.
"""
