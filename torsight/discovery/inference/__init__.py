"""The engine, which knows no physics.

From a problem (model, record, effects, laws) to sets with their evidence and a verdict.
"""
