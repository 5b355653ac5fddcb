"""What both integrators of a model's differential equations, SciPy's and the compiled one, have in common."""

from __future__ import annotations

from typing import Final

ATOL_SHARE: Final = 1e-2
"""Absolute tolerance as a multiple of the relative one: states of the order of 0.01 are still followed."""
RTOL: Final = 1e-7
"""Relative tolerance: derivatives are differences over 2 % of a parameter's scale, which an error of 1e-7 leaves good
to four digits; SciPy's own default of 1e-3 would drown them."""
MOMENT: Final = ATOL_SHARE * RTOL
"""Share of the time by which an integration continues after an event, so that the event does not end the next step: the
absolute tolerance."""
TOO_MANY: Final = (
    "the solver gave up at t = {:g}: the steps became too small or too many, as where a model diverges, or where its "
    "events follow one another ever faster"
)


class TooManyStepsError(ArithmeticError):
    """An integration that would not end."""
