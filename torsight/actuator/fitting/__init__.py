"""A fit as a least-squares problem in scaled parameters in, estimates with intervals (public units) out."""
