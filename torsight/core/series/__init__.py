"""What is read off a series of samples, whatever they measure.

In: arrays (n,) of samples or flags. Out: runs as pairs of indices (begin, end exclusive), the noise of one sample in
the samples' unit, indices of extremes.
"""

from torsight.core.series.extremes import extremes
from torsight.core.series.runs import constant_runs, runs
from torsight.core.series.scatter import robust_sigma, scatter

__all__ = ["constant_runs", "extremes", "robust_sigma", "runs", "scatter"]
