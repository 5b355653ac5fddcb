"""From a film of two sticks to a trusted model of the torsion actuator."""

__version__ = "0.1.0"
