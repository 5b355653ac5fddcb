"""Frozen objects that are passed between the stages, errors, storage and provenance."""

from __future__ import annotations

from torsight.core.lazy import lazily

__getattr__, __dir__ = lazily(__name__, __file__)
