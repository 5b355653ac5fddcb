"""The rig in time.

In: the springs' values in SI units, a protocol of heatings and coolings. Out: angle (rad), temperatures (°C), torque
(N·m) and switches at even steps (s), from an integrator of its own that shares only symbols and reference values with
the model that is fitted.
"""
