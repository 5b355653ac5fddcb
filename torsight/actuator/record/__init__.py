"""A record made ready to drive the model.

Noisy temperatures (°C) in, conditioned ones, half-cycles, turns and row weights out.
"""
