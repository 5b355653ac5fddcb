"""The engine, which knows no physics.

A problem (model, record, effects, laws) in, sets with their evidence and a verdict out.
"""
