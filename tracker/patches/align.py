"""Lucas–Kanade of a patch against a fixed template: inverse compositional, with light and contrast free.

A template T is known around its middle; a picture I shows it through a warp W (3 × 3, from the template's plane to
pixels) in other light:

    I(W u) = o + a · u + g T(D u),    D = 1 + Σ δₖ Gₖ

For small δ this is linear in all that is unknown, and the derivatives belong to the template: they are the same in
every frame. W is replaced by W D⁻¹ until δ vanishes (Baker & Matthews, Lucas–Kanade 20 years on, Int. J. Comput.
Vision 56, 2004, section 3.2, with a linear change of light as in its part 3). The template stays, so nothing drifts.
Where something lies over a part of the patch, its points are weighed down (Tukey's biweight) and the fit repeated.

A drawn template knows nothing of uneven ink: what that leaves is the same in every frame, and as large at single points
as what lies over them. It is learnt point by point, as far as each is seen, and taken out of the picture. What a fit
leaves is perpendicular, by the fit's own weights, to all that is fitted, so to learn it with these weights lets nothing
drift; and a part of the tag has the direction of all that was seen before.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.series import robust_sigma
from torsight.core.units import Flags, Floats
from tracker.patches.alignment import (
    GAIN,
    LIGHT,
    Part,
    Template,
    align_warp,
    found_of,
    largest_step,
    sample,
    step_warp,
)
from tracker.patches.ink import Doubt, Ink
from tracker.patches.warps import jacobian, project

Look = Callable[[Floats, Floats], Floats]
"""Brightness of a template at offsets x, y (n,) from its middle, y down."""

_ROUNDS: Final = 12
_STOP_PX: Final = 0.01
"""Last step of a point at the patch's rim: a tenth of what noise makes of a reading in an ordinary film."""
_ROUNDED: Final = 1.0 / 12.0
"""Variance of brightness that was rounded: no picture is better known, even the one of the template."""
_TUKEY: Final = 4.685
"""Standard deviations from which a point has no weight: 95 % efficient for normal noise (Holland & Welsch 1977)."""
_OTHER_DRAWN: Final = 0.4
_OTHER_SEEN: Final = 1.5
"""What a point may be off at least before it is taken for something else, over the template's spread. Of a drawn tag
it is a fifth of the step from black to white, which smear shorter than a module leaves; texture is shaded anew as it
turns under the light."""
_AROUND: Final = 1.5
"""Standard deviation, in steps of the grid, of the surroundings in which a drawn template is held against the picture:
uneven ink is a line one or two steps wide, and what lies over a tag is wider. With 1.0 ink is now and then taken for
something else; 1.5 and 2.5 do the same."""
_FEW: Final = 0.005
"""Share of such points that does not matter: it is what noise makes."""
_BLUR: Final = 0.5
"""Blur of the picture before it is sampled, in steps of the grid: linear interpolation between blurred pixels hardly
depends on where between them a sample lies."""
_LINEAR_PX2: Final = 1.0 / 6.0
"""Variance of the kernel of linear interpolation, mean of f (1 − f) over all places f between two pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """How a patch lies in a picture: ``warp`` (3, 3), from offsets in the template, px, to pixels.

    ``likeness``: correlation of picture and template, light that falls unevenly taken out, negative for a negative;
    ``inside``: the same for the part that was named at the template's making. ``light``, ``residual``: brightness at
    the template's mean, and root mean square of what the model leaves, grey levels; ``gain``: contrast over the
    template's; ``kept``: share of the points that were used, for the others show something else; ``covariance`` (k, k):
    of the last δ, for white noise of the size of ``residual``; ``left``, ``weight`` (n,): what the template leaves at
    its points, over the gain, and how far they show the patch.
    """

    warp: Floats
    likeness: float
    inside: float
    light: float
    gain: float
    residual: float
    kept: float
    covariance: Floats
    left: Floats
    weight: Floats


class Patch:
    """A template with its derivatives, from its brightness ``look`` at offsets from its middle, px.

    Points ``spacing_px`` apart are compared in a square of half the side ``half_px``, or a disc (``round_``).
    ``freedom`` is how many changes are followed: 2 for the place alone, 6 with turn, scale and both stretches, 8 with
    the perspective of a plane, for templates so large that it shows. ``soft`` lets the sharpness be free, for templates
    that are drawn, and do not know the lens. ``within_px`` is half the side of the part for which likeness is also told
    alone.
    """

    def __init__(
        self,
        look: Look,
        *,
        half_px: float,
        spacing_px: float = 1.0,
        round_: bool = False,
        freedom: int = 6,
        soft: bool = False,
        within_px: float = math.inf,
    ) -> None:
        count = max(2, round(half_px / spacing_px))
        self.half_px, self.spacing_px = half_px, spacing_px
        self.blur_px = _BLUR * spacing_px
        self._side = 2 * count + 1
        y, x = (axis.ravel() * spacing_px for axis in np.mgrid[-count : count + 1, -count : count + 1].astype(float))
        self._grid = np.stack([x, y])
        chosen = np.hypot(x, y) <= half_px if round_ else np.ones(len(x), bool)
        self._index = np.flatnonzero(chosen)
        x, y = x[chosen], y[chosen]
        self.generators = _generators(half_px)[:freedom]
        around = np.exp(0.25j * np.pi * np.arange(8)) if round_ else np.array([1 + 1j, 1 - 1j, -1 + 1j, -1 - 1j])
        self._rim = half_px * np.stack([around.real, around.imag])
        self.soft = soft
        self._other = _OTHER_DRAWN if soft else _OTHER_SEEN
        self._share = self._around(np.ones(len(x))) if soft else None
        self._solve_for(look, x, y, soft=soft)
        self._template = Template(
            np.stack([x, y]), np.ascontiguousarray(self._inverse), self.generators, self._rim, half_px, self.spread
        )
        self._within = (np.abs(x) < within_px) & (np.abs(y) < within_px) if math.isfinite(within_px) else None

    def _solve_for(self, look: Look, x: Floats, y: Floats, *, soft: bool) -> None:
        """Prepare the least-squares inverse, and what white noise makes of its solution."""
        step = 0.5 * self.spacing_px
        middle = look(x, y)
        right, left, down, up = look(x + step, y), look(x - step, y), look(x, y + step), look(x, y - step)
        slope_x, slope_y = (right - left) / (2.0 * step), (down - up) / (2.0 * step)
        columns = [np.ones_like(x), x / self.half_px, y / self.half_px, middle - middle.mean()]
        if soft:
            columns.append((right + left + down + up - 4.0 * middle) / step**2)
        self._first = len(columns)
        moved = self.generators @ np.stack([x, y, np.ones_like(x)])
        self._along_x, self._along_y = (moved[:, 0] - x * moved[:, 2]).T, (moved[:, 1] - y * moved[:, 2]).T
        self._basis = np.column_stack([*columns, self._columns(slope_x, slope_y)])
        self._trusted = np.ones(len(x))
        self._inverse = np.linalg.pinv(self._basis, rcond=1e-9)
        plain = self._basis[:, :3]
        self._plain = np.linalg.pinv(plain)
        self.mean, self.spread = float(middle.mean()), float((middle - plain @ (self._plain @ middle)).std())
        self._noise = self._overlap(self._inverse)

    def _weigh(self, weight: Floats) -> None:
        """Let points count by their weights (n,) from here on."""
        if weight is self._trusted:
            return
        root = np.sqrt(weight)[:, None]
        self._trusted = weight
        self._inverse = np.linalg.pinv(root * self._basis, rcond=1e-9) * root.T
        self._plain = np.linalg.pinv(root * self._basis[:, :3]) * root.T
        self._noise = self._overlap(self._inverse)
        self._template = self._template._replace(inverse=np.ascontiguousarray(self._inverse))

    @property
    def count(self) -> int:
        """Return how many points are compared."""
        return len(self._index)

    @property
    def turn_doubt(self) -> float:
        """How much worse the turn (in px at the rim) shows than the place."""
        variance = np.diag(self._noise)
        return math.sqrt(float(variance[2] / variance[:2].max())) if len(variance) > 2 else math.inf

    def _overlap(self, inverse: Floats) -> Floats:
        """Return the covariance of δ times gain for residuals of variance 1 from white noise in the picture."""
        kernel_px2 = self.blur_px**2 + _LINEAR_PX2
        sigma = math.sqrt(kernel_px2) / self.spacing_px
        rows = np.zeros((len(self.generators), self._side * self._side), np.float32)
        rows[:, self._index] = inverse[self._first :]
        seen = np.stack(
            [
                cv2.GaussianBlur(row.reshape(self._side, -1), (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
                for row in rows
            ]
        ).reshape(len(rows), -1)
        # A sample holds 1/(4πσ²) of the variance of a pixel's noise, the solution the overlap of the samples' kernels.
        return np.asarray(4.0 * math.pi * kernel_px2 / self.spacing_px**2 * (seen @ seen.T), dtype=np.float64)

    def cut(self, luma: NDArray[np.uint8], warp: Floats, *, reach_px: float = 6.0) -> Part:
        """Return the part of a picture around where the patch should be."""
        corners = project(warp, self._rim)
        height, width = luma.shape
        low, high = corners.min(axis=1) - reach_px, corners.max(axis=1) + reach_px
        middle = 0.5 * (low + high)
        half = math.ceil(0.5 * float((high - low).max()))
        cx, cy = round(float(middle[0])), round(float(middle[1]))
        part = cut_out(luma, cx, cy, half).astype(np.float32)
        blurred = cv2.GaussianBlur(part, (0, 0), self.blur_px)
        # Both what was cut out and the picture itself end there.
        left, top, side = cx - half, cy - half, 2 * half + 1
        low_px = (max(left, 0) - 1.0, max(top, 0) - 1.0)
        high_px = (float(min(left + side, width)), float(min(top + side, height)))
        return Part(np.asarray(blurred, dtype=np.float32), left, top, low_px, high_px)

    def align(
        self, luma: NDArray[np.uint8], warp: Floats, learnt: Ink | None = None, doubt: Doubt | None = None
    ) -> Fit | None:
        """Return how the patch lies near a first guess; None where it leaves the picture or is not found."""
        if not self.in_picture(warp, luma):
            return None
        if doubt is not None:
            self._weigh(doubt.weight)
        cut = self.cut(luma, warp)
        usual = np.zeros(len(self._index)) if learnt is None else learnt.left
        good, moved, before, warp = align_warp(warp, self._template, cut, self._inverse @ usual, _ROUNDS, _STOP_PX)
        if not good or moved > 10.0 * _STOP_PX:
            return None
        seen = sample(cut, before, self._grid)
        values = seen[self._index]
        found = found_of(self._inverse @ values, self._inverse @ usual)
        left = values - self._basis @ found - found[GAIN] * usual
        all_known = learnt is not None and np.count_nonzero(learnt.known) > (1.0 - _FEW) * len(left)
        # Held against its own scatter all of a patch would be seen, whatever lies over it.
        noise = learnt.noise * abs(float(found[GAIN])) if learnt and all_known else robust_sigma(left)
        # What an edge leaves differs by frames, and what lies over a tag is wider: no point is judged by itself.
        weight = self._weights(left, self._limit(found, noise, learnt), np.zeros(len(left), np.bool_))
        seen_whole = np.count_nonzero(weight) > (1.0 - _FEW) * len(left)
        if seen_whole and (all_known or learnt is None or not learnt.known.any()):
            return self._fit(seen, usual, found, warp, self._trusted, self._inverse)
        return self._align_in_part(cut, warp, left, found, learnt)

    def _align_in_part(self, cut: Part, warp: Floats, left: Floats, found: Floats, learnt: Ink | None) -> Fit | None:
        """Go on with the points that show the patch, and learn meanwhile which do.

        What was learnt of their ink refuses all that is a little off: near the right place alone.
        """
        usual = np.zeros(len(left)) if learnt is None else learnt.left
        known = np.zeros(len(left), np.bool_) if learnt is None else learnt.known
        near = learnt is None
        weight = self._weights(left, self._limit(found, robust_sigma(left), learnt if near else None), known)
        for _ in range(_ROUNDS):
            seen = sample(cut, warp, self._grid)
            values = seen[self._index] - found[GAIN] * usual
            trust = 1.0 if learnt is None else learnt.trust((values - self._basis @ found) / found[GAIN], weight)
            weighted = (trust * weight)[:, None] * self._basis
            normal = weighted.T @ self._basis
            normal[np.diag_indices_from(normal)] *= 1.0 + 1e-9
            try:
                inverse = np.linalg.solve(normal, weighted.T)
            except np.linalg.LinAlgError:
                return None
            found = inverse @ values
            good, after = step_warp(found, warp, self._template, cut)
            if not good:
                return None
            moved, warp = largest_step(warp, after, self._rim), after
            left = values - self._basis @ found
            if moved < _STOP_PX and near:
                break
            near = near or moved < _STOP_PX
            weight = self._weights(left, self._limit(found, robust_sigma(left), learnt if near else None), known)
        return self._fit(seen, usual, found, warp, weight, inverse)

    def _limit(self, found: Floats, noise: float, learnt: Ink | None) -> Floats:
        """Return from what on what is left at a point (n,) is something else's, where its ink was learnt by that."""
        gain = abs(float(found[GAIN]))
        # A tag that stands still is sent once: what frames of it differ by then is less than they may be off.
        noise = max(noise, math.sqrt(_ROUNDED))
        usual = np.full(len(self._index), max(_TUKEY * noise, self._other * self.spread * gain))
        if learnt is None:
            return usual
        return np.where(learnt.known, _TUKEY * gain * np.sqrt(learnt.variance(noise / gain)), usual)

    def _weights(self, left: Floats, limit: Floats, alone: Flags) -> Floats:
        """Return how far points show the patch; of a drawn one surroundings tell, unless points (n,) count alone."""
        beyond = np.square(left) / limit**2
        if self._share is not None and not alone.all():
            beyond = np.where(alone, beyond, self._around(beyond) / self._share)
        return np.asarray(self._trusted * np.square(np.clip(1.0 - beyond, 0.0, None)))

    def _around(self, values: Floats) -> Floats:
        """Return the sum of values (n,) around every point, weighted by a normal distribution."""
        grid = np.zeros(self._side * self._side, np.float32)
        grid[self._index] = values
        seen = cv2.GaussianBlur(grid.reshape(self._side, -1), (0, 0), _AROUND, borderType=cv2.BORDER_CONSTANT)
        return np.asarray(seen.ravel()[self._index], dtype=np.float64)

    def _fit(self, seen: Floats, usual: Floats, found: Floats, warp: Floats, weight: Floats, inverse: Floats) -> Fit:
        values, root = seen[self._index] - found[GAIN] * usual, np.sqrt(weight)
        left = root * (values - self._basis @ found)
        plain = root * (values - self._basis[:, :3] @ (self._plain @ values))
        if inverse is not self._inverse:
            used = self._basis[:, :3] * root[:, None]
            plain = root * values - used @ np.linalg.lstsq(used, root * values, rcond=None)[0]
        gain, total = float(found[GAIN]), float(weight.sum())
        variance = max(float(left @ left) / max(total - len(found), 1.0), _ROUNDED)
        return Fit(
            warp=warp,
            likeness=math.copysign(_likeness(left, plain), gain),
            inside=_correlation((self._basis @ found)[self._within], values[self._within])
            if self._within is not None
            else math.nan,
            light=float(found[LIGHT]),
            gain=gain,
            residual=math.sqrt(variance),
            kept=float(np.count_nonzero(weight > 0.0)) / len(weight),
            covariance=variance * self._spread_of(seen, inverse),
            left=(values - self._basis @ found) / gain + usual,
            weight=weight,
        )

    def _spread_of(self, seen: Floats, inverse: Floats) -> Floats:
        """Return the covariance of δ for residuals of variance 1.

        A picture that is smeared answers a shift with less than the template does: its own slopes tell by how much.
        """
        down, right = (
            axis.ravel()[self._index] / self.spacing_px for axis in np.gradient(seen.reshape(self._side, -1))
        )
        answer = np.linalg.pinv(inverse[self._first :] @ self._columns(right, down))
        noise = self._noise if inverse is self._inverse else self._overlap(inverse)
        return np.asarray(answer @ noise @ answer.T, dtype=np.float64)

    def _columns(self, slope_x: Floats, slope_y: Floats) -> Floats:
        """Return how brightness changes with δ (n, k) from its slopes."""
        return np.asarray(slope_x[:, None] * self._along_x + slope_y[:, None] * self._along_y, dtype=np.float64)

    def slope(self, warp: Floats, at: tuple[float, float]) -> Floats:
        """Return how a point of the template moves in the picture with δ, (2, k) px."""
        x, y = at
        moved = self.generators @ np.array([x, y, 1.0])
        inside = np.stack([moved[:, 0] - x * moved[:, 2], moved[:, 1] - y * moved[:, 2]])
        return np.asarray(-jacobian(warp, at) @ inside, dtype=np.float64)

    def in_picture(self, warp: Floats, luma: NDArray[np.uint8]) -> bool:
        """Return whether all of the patch lies in a picture."""
        corners = project(warp, self._rim)
        height, width = luma.shape
        return bool(
            np.isfinite(corners).all()
            and corners.min() > -1.0
            and corners[0].max() < width
            and corners[1].max() < height
        )


def _generators(half_px: float) -> Floats:
    """Return what δ does, (8, 3, 3): two shifts, turn, scale, two stretches, and two of perspective.

    One unit of each moves the rim by about a pixel.
    """
    r = 1.0 / half_px
    found = [
        [[0, 0, 1], [0, 0, 0], [0, 0, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 0, 0]],
        [[0, -r, 0], [r, 0, 0], [0, 0, 0]],
        [[r, 0, 0], [0, r, 0], [0, 0, 0]],
        [[r, 0, 0], [0, -r, 0], [0, 0, 0]],
        [[0, r, 0], [r, 0, 0], [0, 0, 0]],
        [[0, 0, 0], [0, 0, 0], [r * r, 0, 0]],
        [[0, 0, 0], [0, 0, 0], [0, r * r, 0]],
    ]
    return np.array(found, dtype=np.float64)


def _correlation(one: Floats, other: Floats) -> float:
    a, b = one - one.mean(), other - other.mean()
    return float(a @ b) / math.sqrt(max(float(a @ a) * float(b @ b), 1e-12))


def _likeness(left: Floats, plain: Floats) -> float:
    """Return the correlation that leaves ``left`` of a variation ``plain``."""
    total = float(plain @ plain)
    return 0.0 if total <= 0.0 else math.sqrt(max(0.0, 1.0 - float(left @ left) / total))


def cut_out(luma: NDArray[np.uint8], cx: int, cy: int, half: int) -> NDArray[np.uint8]:
    """Return the square around a pixel; outside the picture its border is repeated."""
    height, width = luma.shape
    if half <= cx < width - half and half <= cy < height - half:
        return luma[cy - half : cy + half + 1, cx - half : cx + half + 1]
    rows = np.clip(np.arange(cy - half, cy + half + 1), 0, height - 1)
    columns = np.clip(np.arange(cx - half, cx + half + 1), 0, width - 1)
    return luma[np.ix_(rows, columns)]
