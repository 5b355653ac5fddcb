"""What is read off a series of samples, whatever they measure.

In: arrays (n,) of samples or flags. Out: runs as pairs of indices (begin, end exclusive), the noise of one sample in
the samples' unit, the correlation time in samples, indices of extremes, the usual step of times.
"""

from torsight.core.series.correlation import correlation_time
from torsight.core.series.extremes import extremes
from torsight.core.series.runs import constant_runs, runs
from torsight.core.series.sampling import block_means, extent, usual_step
from torsight.core.series.scatter import APART, BY_CHANCE, rms, robust_sigma, scatter, share_explained

__all__ = [
    "APART",
    "BY_CHANCE",
    "block_means",
    "constant_runs",
    "correlation_time",
    "extent",
    "extremes",
    "rms",
    "robust_sigma",
    "runs",
    "scatter",
    "share_explained",
    "usual_step",
]
