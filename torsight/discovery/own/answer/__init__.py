"""Findings on a model of one's own: from the engine's answer to words, pictures, tables and files."""
