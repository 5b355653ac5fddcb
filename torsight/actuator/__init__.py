"""The torsion actuator: springs, phase laws, the stepping rule, effects, fits and characterisation."""

from __future__ import annotations

from torsight.core.lazy import lazily

__getattr__, __dir__ = lazily(__name__, __file__)
