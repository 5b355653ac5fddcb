"""Frozen objects that cross the stages, errors, storage and provenance."""
