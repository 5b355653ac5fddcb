"""Characterisation: a spring's values with intervals (public units) and figures, from the logs of four tests."""
