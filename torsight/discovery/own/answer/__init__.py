"""What was found on a model of one's own: findings of the engine in, words, pictures, tables and files out."""
