"""Laws measured by their marginal likelihood.

From a problem, one of its laws and a set's values to the law's curve and its evidence.
"""
