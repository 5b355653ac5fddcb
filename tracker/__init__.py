"""From a film of two sticks to the angle between them in every frame, with its uncertainty."""

from __future__ import annotations

from torsight.core.lazy import lazily

__getattr__, __dir__ = lazily(__name__, __file__)
