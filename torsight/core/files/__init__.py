"""Files of a run: paths in, whole files out; JSON, TOML and CSV in the units of the file to and from records in SI."""
