"""The results of the tracker: marker positions, and the angle computed from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.frozen import Columns
from torsight.core.units import DEG, Flags, Floats, Ints
from torsight.core.words.shown import Shown, draw_series, share, span
from torsight.core.words.wording import number

MARKERS: Final = ("base_inner", "base_outer", "moving_inner", "moving_outer")
"""The order of the four markers wherever an axis has length four."""
USUAL_SHARE: Final = 0.9
"""Share of the frames with a result above which a track has no warning, by the contract."""
FEW: Final = (1.0 - USUAL_SHARE) / 5.0
"""Share of a film's frames, or of its time, that is not reported: a fifth of the share that a track may lack without a
warning."""
LEAST_SURE: Final = 0.55
"""Least probability that the chosen markers are the right ones: below it a film has no result.

Where nothing distinguishes two pairs of sticks the likelier one has 0.50 to 0.51; in all films with 0.6 to 0.95 the
choice is right (benchmarks/tracking/decoys.py).
"""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MarkerTracks(Shown):
    """Positions of the four markers in every frame of one film.

    Attributes
    ----------
    frame : (n,) int64
        Frame number, from 0, none missing.
    time_s : (n,) float64
        Time of the frame on the film's clock.
    position_px : (n, 4, 2) float64
        x to the right and y down, pixel centres at whole numbers, order of :data:`MARKERS`; NaN where not valid.
    covariance_px2 : (n, 4, 2, 2) float64
        Covariance of each position; NaN where not valid.
    valid : (n, 4) bool
        Whether the position was measured in this frame.
    size_px : (int, int)
        Width and height of the picture.
    choice_rad2 : float
        Variance of the angle due to an uncertain choice of the markers among the dots, or of a stick's inner marker:
        the variance over the angles of all choices, weighted by their probabilities. All frames share this error.
    """

    frame: Ints
    time_s: Floats
    position_px: Floats
    covariance_px2: Floats
    valid: Flags
    size_px: tuple[int, int]
    choice_rad2: float = 0.0

    def __post_init__(self) -> None:
        n = len(self.frame)
        shapes = {"time_s": (n,), "position_px": (n, 4, 2), "covariance_px2": (n, 4, 2, 2), "valid": (n, 4)}
        for name, expected in shapes.items():
            if (shape := getattr(self, name).shape) != expected:
                msg = f"{name} has shape {shape}, expected {expected}"
                raise ValueError(msg)

    @classmethod
    def unseen(cls, time_s: Floats, size_px: tuple[int, int]) -> MarkerTracks:
        """Return the tracks of a film in which no marker is seen, from the times of its frames."""
        n = len(time_s)
        position, covariance = np.full((n, 4, 2), np.nan), np.full((n, 4, 2, 2), np.nan)
        return cls(np.arange(n), time_s, position, covariance, np.zeros((n, 4), np.bool_), size_px)

    def __len__(self) -> int:
        return len(self.frame)

    def facts(self) -> dict[str, str]:
        """Return frames, time, the share of frames with all markers, and the picture's size."""
        return {
            "frames": str(len(self)),
            "time": span(self.time_s, "s"),
            "all four markers": f"in {share(self.valid.all(axis=1))} of the frames",
            "picture": f"{self.size_px[0]} × {self.size_px[1]} px",
        }

    def _columns(self) -> dict[str, Any]:
        return marker_columns(self)

    def _draw(self, axes: Any) -> None:
        """Draw the markers' paths in the coordinates of the picture."""
        for index, name in enumerate(MARKERS):
            axes.plot(*self.position_px[:, index].T, ".", markersize=2, label=name)
        axes.set(xlabel="x, px", ylabel="y, px", xlim=(0, self.size_px[0]), ylim=(self.size_px[1], 0), aspect="equal")
        axes.legend()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StickAngles(Columns, Shown):
    """The actuator angle: orientation of the moving stick against the base stick.

    Attributes
    ----------
    frame : (n,) int64
        Frame number, from 0, none missing.
    time_s : (n,) float64
        Time of the frame on the film's clock.
    angle_rad : (n,) float64
        Positive counter-clockwise as the picture is displayed, unwrapped; NaN where not valid.
    sigma_rad : (n,) float64
        One standard deviation of ``angle_rad``; NaN where not valid.
    valid : (n,) bool
        Whether the angle is known in this frame.
    branch_certain : (n,) bool
        False after a gap over which the motion on both sides does not determine the whole turn.
    extra : mapping of str to (n,) array
        Further columns of a table that was read, kept under their own names.
    """

    frame: Ints
    time_s: Floats
    angle_rad: Floats
    sigma_rad: Floats
    valid: Flags
    branch_certain: Flags
    extra: Mapping[str, NDArray[np.generic]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.frame)

    def facts(self) -> dict[str, str]:
        """Return frames, time, angle and its uncertainty."""
        sigma_deg = float(np.median(self.sigma_rad[self.valid])) / DEG if self.valid.any() else np.nan
        return {
            "frames": str(len(self)),
            "time": span(self.time_s, "s"),
            "angle": f"{span(self.angle_rad / DEG, '°')} in {share(self.valid)} of the frames",
            "sigma": f"{number(sigma_deg, 2)}°",
        }

    def _columns(self) -> dict[str, Any]:
        return angle_columns(self)

    def _draw(self, axes: Any) -> None:
        draw_series(axes, self.time_s, {"angle": self.angle_rad / DEG}, label="angle, °")


def mean_sigma(covariance: Floats) -> Floats:
    """Return the rms (...) of the standard deviations of both coordinates, from covariances (..., 2, 2)."""
    return np.asarray(np.sqrt(0.5 * np.trace(covariance, axis1=-2, axis2=-1)))


def round_covariance(sigma: Floats) -> Floats:
    """Return the isotropic covariances (..., 2, 2) of positions with the standard deviations (...) per coordinate."""
    return sigma[..., None, None] ** 2 * np.eye(2)


def marker_columns(tracks: MarkerTracks, position_mm: Floats | None = None) -> dict[str, Any]:
    """Return the columns of ``markers.csv``.

    ``m_sigma_px`` is :func:`mean_sigma`; ``position_mm`` (n, 4, 3) adds the positions in space of a calibrated camera.
    """
    columns: dict[str, Any] = {"frame": tracks.frame, "time_s": tracks.time_s}
    for index, name in enumerate(MARKERS):
        columns[f"{name}_x_px"] = tracks.position_px[:, index, 0]
        columns[f"{name}_y_px"] = tracks.position_px[:, index, 1]
        columns[f"{name}_sigma_px"] = mean_sigma(tracks.covariance_px2[:, index])
        columns[f"{name}_valid"] = tracks.valid[:, index]
        if position_mm is not None:
            for axis, letter in enumerate("xyz"):
                columns[f"{name}_{letter}_mm"] = position_mm[:, index, axis]
    return columns


def angle_columns(angles: StickAngles) -> dict[str, Any]:
    """Return the columns of ``angle.csv``."""
    return {
        "frame": angles.frame,
        "time_s": angles.time_s,
        "angle_deg": angles.angle_rad / DEG,
        "angle_sigma_deg": angles.sigma_rad / DEG,
        "valid": angles.valid,
        "branch_certain": angles.branch_certain,
        **angles.extra,
    }
