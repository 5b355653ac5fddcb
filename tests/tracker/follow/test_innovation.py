import pytest
from scipy.stats import chi2, norm

from tracker.innovation import LIMITS, SIGMAS, passes


def test_limits_are_the_quantiles_of_chi_squared() -> None:
    for freedom, limit in enumerate(LIMITS, 1):
        assert limit == pytest.approx(chi2.isf(2.0 * norm.sf(SIGMAS), freedom), abs=6e-3)
        assert passes(limit - 1e-6, freedom)
        assert not passes(limit + 1e-6, freedom)
