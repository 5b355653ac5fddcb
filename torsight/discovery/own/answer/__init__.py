"""What was found on a model of one's own: from the engine's findings to words, pictures, tables and files."""
