"""A base dot that the moving stick half covers: displaced, while the other one stays."""

from __future__ import annotations

import numpy as np
import pytest

from tracker.angle.partial_occlusion import cover_base, half_covered
from tracker.rows import CODE, ROW

RADIUS_PX = 8.0
SIGMA_PX = 0.05
FRAMES = 400
RUN = slice(150, 190)
HUMP = np.sin(np.linspace(0.0, np.pi, 40))[:, None] * [1.5, -2.0]


def rows_of(*, stick_away_px: float = 25.0, seed: int = 0) -> np.ndarray:
    """Return base dots at their places with noise; the moving stick passes the inner one at this distance."""
    rng = np.random.default_rng(seed)
    rows = np.zeros(FRAMES, ROW)
    rows["time_s"] = np.arange(FRAMES) / 30.0
    away = stick_away_px + np.abs(np.arange(FRAMES) - 170.0)
    rows["position_px"][:, 0], rows["position_px"][:, 1] = (200.0, 200.0), (300.0, 200.0)
    rows["position_px"][:, 2] = np.stack([np.full(FRAMES, 180.0), 200.0 + away], axis=1)
    rows["position_px"][:, 3] = np.stack([np.full(FRAMES, 280.0), 200.0 + away], axis=1)
    rows["position_px"] += rng.normal(0.0, SIGMA_PX, (FRAMES, 4, 2))
    rows["covariance_px2"][..., [0, 2]] = SIGMA_PX**2
    rows["step"], rows["residual"] = -25.0, 3.0
    return rows


def cover(rows: np.ndarray, *, marker: int = 0) -> None:
    rows["position_px"][RUN, marker] += HUMP
    rows["residual"][RUN, marker] += 1.5
    rows["step"][RUN, marker] += 2.0


def test_a_half_covered_dot_is_not_taken() -> None:
    rows = rows_of()
    cover(rows)
    covered = half_covered(rows, radius_px=RADIUS_PX)
    assert not covered[:, 1].any()
    at = np.flatnonzero(covered[:, 0])
    # From where it first leaves its place until it is back, and nothing else.
    assert np.array_equal(at, np.arange(at[0], at[-1] + 1))
    assert RUN.start - 1 <= at[0] <= RUN.start + 2
    assert RUN.stop - 3 <= at[-1] <= RUN.stop
    cover_base(rows, radius_px=RADIUS_PX)
    assert (rows["state"][at, 0] == CODE["shadowed"]).all()
    assert np.isnan(rows["position_px"][at, 0]).all()
    assert np.isfinite(rows["position_px"][:, 1:]).all()
    assert (np.delete(rows["state"], at, axis=0) == CODE["seen"]).all()


def test_also_after_a_bump_of_the_camera() -> None:
    rows = rows_of()
    cover(rows)
    rows["position_px"][130:] += [6.0, -4.0]
    covered = half_covered(rows, radius_px=RADIUS_PX)
    assert covered[155:185, 0].all()
    assert covered.sum() <= 42
    rows = rows_of()
    cover(rows)
    rows["position_px"][230:] += [6.0, -4.0]
    assert half_covered(rows, radius_px=RADIUS_PX)[155:185, 0].all()


@pytest.mark.parametrize("what", ["nothing", "bump", "shake", "stick far", "good fit", "small"])
def test_what_is_not_covered_is_kept(what: str) -> None:
    rows = rows_of(stick_away_px=80.0 if what == "stick far" else 25.0)
    if what == "bump":
        rows["position_px"][150:, :2] += [2.0, 1.0]
    if what == "shake":
        rows["position_px"] += np.random.default_rng(1).normal(0.0, 0.8, (FRAMES, 1, 2))
    if what in ("stick far", "good fit"):
        cover(rows)
    if what == "good fit":
        rows["residual"], rows["step"] = 3.0, -25.0
    if what == "small":
        rows["position_px"][RUN, 0] += 0.1 * HUMP
        rows["residual"][RUN, 0] += 1.5
    assert not half_covered(rows, radius_px=RADIUS_PX).any()


def test_a_film_too_short_to_tell() -> None:
    assert half_covered(rows_of()[:20], radius_px=RADIUS_PX).shape == (20, 2)
    assert not half_covered(rows_of()[:0], radius_px=RADIUS_PX).any()
