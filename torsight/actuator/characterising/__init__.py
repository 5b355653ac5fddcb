"""Characterisation: from the logs of four tests of a spring to its values with intervals (public units) and figures."""
