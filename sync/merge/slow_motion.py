"""Whether a film plays slower than it was filmed: it is then longer than its log by a power of two."""

from __future__ import annotations

from typing import Final

_FACTORS: Final = (2, 4, 8, 16, 32)
"""Cameras film 60, 120, 240, 480 or 960 frames a second and play them at 30."""
_NEAR: Final = 0.1
"""Share by which the lengths may be off such a factor, where log and camera are started and stopped by hand: a choice,
which decides over a warning alone."""


def slow_motion_factor(film_s: float, log_s: float) -> int | None:
    """Return how many times slower a film seems to play than it was filmed; None where nothing hints at it.

    A log that is longer than its film is usual and says nothing. One that is shorter by a factor of 2, 4, 8, … is
    not: a log is let run for as long as the camera.
    """
    if not (film_s > 0.0 and log_s > 0.0):
        return None
    return next((factor for factor in _FACTORS if abs(film_s / log_s / factor - 1.0) < _NEAR), None)


def slow_motion_text(film_s: float, log_s: float, *, rate_fps: float | None) -> tuple[str, str] | None:
    """Return the warning and the advice for lengths that look like slow motion; None where they do not.

    ``rate_fps`` is the rate at which the film plays.
    """
    factor = slow_motion_factor(film_s, log_s)
    if factor is None:
        return None
    text = (
        f"the film ({film_s:.1f} s) is {film_s / log_s:.1f} times as long as the log ({log_s:.1f} s): it looks like "
        f"slow motion, filmed {factor} times as fast as it plays, and all times and rates are wrong if so"
    )
    rate = "the rate at which it was filmed" if rate_fps is None else f"{factor * rate_fps:.4g}"
    return text, f"if it is, give the rate of filming: fps = {rate} in [video] of the experiment, or --fps"
