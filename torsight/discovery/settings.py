"""How the engine decides."""

from __future__ import annotations

import math
from dataclasses import dataclass

from torsight.core.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Settings:
    """How the engine decides: probabilities, a share, and budgets.

    Attributes
    ----------
    missing : float
        Prior probability that one further effect or law is missing, shared equally by all effects and laws. Two have
        the square of it.
    certain : float
        Probability that something is missing from which the verdict says so.
    credible : float
        Share of the probability whose sets are reported as explanations.
    form_share : float
        Share of what a free law explains that a usual form of it must explain, too, to give the law its name.
    most : int
        Number of effects and laws in the largest set that is tried.
    beam : int
        Number of sets of each size that are extended.
    starts : int
        Number of draws of the base values from which a law is measured beside a best set that leaves the record
        unexplained. Of six draws beside a late sensor three led to the best optimum, so that four miss it in one of 16.
    """

    missing: float = 0.5
    certain: float = 0.99
    credible: float = 0.95
    form_share: float = 0.97
    most: int = 4
    beam: int = 2
    starts: int = 4

    def __post_init__(self) -> None:
        for name in ("missing", "certain", "credible", "form_share"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise ConfigError(f"{name} is no probability", value=getattr(self, name), limit="between 0 and 1")
        for name in ("most", "beam", "starts"):
            if not getattr(self, name) >= 1:
                raise ConfigError(f"{name} is too small", value=getattr(self, name), limit="1 or more")

    def price(self, choices: int) -> float:
        """Return the cost, in log units, of one more member of a set that is chosen from ``choices`` candidates."""
        return math.log(max(choices, 1) / self.missing)

    @property
    def surely(self) -> float:
        """Change of −2 log L, beyond the prior's price, from which it is certain that something is missing."""
        return 2.0 * math.log(self.certain / (1.0 - self.certain))

    @property
    def apart(self) -> float:
        """Change of −2 log L from which one alone is reported of two sets with equal priors."""
        return 2.0 * math.log(self.credible / (1.0 - self.credible))
