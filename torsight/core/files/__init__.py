"""Files of a run: atomic writing, and conversion of JSON, TOML and CSV (units of files) to and from records (SI)."""
