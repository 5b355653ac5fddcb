"""A record made ready to drive the model.

In: noisy temperatures (°C). Out: conditioned ones, half-cycles, turns and row weights.
"""
