"""Characterisation: four tests of one spring as logs in, its values with intervals (public units) and figures out."""
