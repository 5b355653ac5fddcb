"""The command ``torsight``: one light module per command; heavy imports stay inside the functions."""
