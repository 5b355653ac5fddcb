"""Preprocessing of a record for the model.

Input: noisy temperatures (°C). Output: conditioned temperatures, half-cycles and turns.
"""
