"""Plots: their content, and its drawing on screen and on paper.

In: curves, points and bands in the units of their axes' labels. Out: Bokeh plots for the screen, SVG and PNG from
matplotlib, symbols and equations as SVG; colours for a light screen, a dark one and paper.
"""
