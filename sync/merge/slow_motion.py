"""Detection of a film in slow motion: it is longer than its log by a power of two."""

from __future__ import annotations

from typing import Final

from tracker.frames.frame import SLOW_MOTION

_NEAR: Final = 0.1
"""Largest relative deviation of the ratio of durations from such a factor, as log and camera are started and stopped by
hand: a choice, which affects a warning only."""


def slow_motion_factor(film_s: float, log_s: float) -> int | None:
    """Return the factor by which a film seems to play slower than it was filmed; None without an indication.

    A log that is longer than its film is usual and no indication. A log that is shorter by a factor of 2, 4, 8, … is an
    indication, because a log usually runs as long as the camera.
    """
    if not (film_s > 0.0 and log_s > 0.0):
        return None
    return next((factor for factor in SLOW_MOTION if abs(film_s / log_s / factor - 1.0) < _NEAR), None)


def slow_motion_text(film_s: float, log_s: float, *, rate_fps: float | None) -> tuple[str, str] | None:
    """Return the warning and the advice for durations that indicate slow motion; None for others.

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
