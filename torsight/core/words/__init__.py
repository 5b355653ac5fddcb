"""Presentation of results: words, tables, plots and colours for values in the units of the files."""
