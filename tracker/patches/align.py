"""Lucas–Kanade of a patch against a fixed template: inverse compositional, with free brightness and contrast.

A template T is known around its middle; a picture I shows it through a warp W (3 × 3, from the template's plane to
pixels) under other illumination:

    I(W u) = o + a · u + g T(D u),    D = 1 + Σ δₖ Gₖ

For small δ this is linear in all unknowns, and the derivatives belong to the template: they are the same in every
frame. W is replaced by W D⁻¹ until δ vanishes (Baker & Matthews, Lucas–Kanade 20 years on, Int. J. Comput. Vision 56,
2004, section 3.2, with a linear change of illumination as in its part 3). The template is fixed, so nothing drifts.
Where a part of the patch is occluded, its points get lower weights (Tukey's biweight) and the fit is repeated.

A drawn template does not contain uneven ink, whose residuals are the same in every frame, and as large at single points
as those of an occluder. They are learnt point by point, in the frames in which each point is seen, and subtracted from
the picture. The residuals of a fit are orthogonal, under its own weights, to everything fitted, so learning them with
these weights causes no drift; and a partly occluded tag gets the same direction as the whole tag.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import compiled
from torsight.core.series import robust_sigma, rounding_variance
from torsight.core.units import Flags, Floats, Ints
from tracker.innovation import SIGMAS
from tracker.patches.ink import Doubt, Ink
from tracker.patches.warps import before_step, jacobian, project, similarity

Look = Callable[[Floats, Floats], Floats]
"""Brightness of a template at offsets x, y (n,) from its middle, y down."""
Smear = Callable[[Floats], Floats]
"""What motion blur adds on a template's whole grid, if its motion since the last frame ends at a warp."""
_LIGHT, _GAIN = 0, 3
"""Rows of the solution: brightness at the middle, with its gradient in rows 1 and 2, and contrast over the template's;
then other nuisance parameters, and δ times the contrast."""

_ROUNDS: Final = 12
_MOVED: Final = 2
"""Rounds whose warps give the motion blur: at the first guess, and after a step, which reaches its end to a few per
cent of the motion."""
_STOP: Final = 0.01
"""Step of a point at the patch's rim, over that of the grid, below which the fit stops: a tenth of a reading's noise in
an ordinary film."""
_REACH: Final = 6.0
"""Steps of the grid by which the rim may move from the first guess."""
_TUKEY: Final = 4.685
"""Standard deviations above which a point has no weight: 95 % efficient for normal noise (Holland & Welsch 1977)."""
_OTHER_DRAWN: Final = 0.4
_OTHER_SEEN: Final = 1.5
"""Residual up to which no point counts as occluded, over the template's spread. For a drawn tag it is a fifth of the
step from black to white, the residual of motion blur shorter than a module; the shading of texture changes as it turns
under the lamp."""
_AROUND: Final = 1.5
"""Standard deviation, in steps of the grid, of the kernel over which squared residuals of a drawn template are
averaged: uneven ink is a line one or two steps wide, and an occluder is wider. With 1.0 ink is now and then taken for
an occluder; 1.5 and 2.5 do the same."""
_FEW: Final = 0.005
"""Share of points without weight that noise alone makes, and that does not matter."""
_BLUR: Final = 0.5
"""Blur of the picture before it is sampled, in steps of the grid."""
_DOUBLED: Final = np.array([[2.0, 0.0, 0.5], [0.0, 2.0, 0.5], [0.0, 0.0, 1.0]])
"""From pixels of a picture to those of one of twice the resolution, in which drawn templates are sampled. The error of
linear interpolation depends on where between two pixels a sample lies. Along an edge that lies along the pixel rows it
is the same everywhere, and moves the edge: it turned noiseless tags of 20 to 58 px by up to 0.13 degrees, and between
half pixels by up to 0.05. A template from the film has errors of its own, of the same kind."""


class _Part(NamedTuple):
    """Part of a picture, blurred, the position of its top left pixel, and the limits (2,) of valid positions."""

    values: NDArray[np.float32]
    corner: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Fit of a patch in a picture: ``warp`` (3, 3), from offsets in the template, px, to pixels.

    ``likeness``: correlation of picture and template without the gradient of illumination, negative for an inverted
    picture; ``inside``: correlation of the part within ``within_px`` of :class:`Patch`. ``light``, ``residual``:
    brightness at the template's mean, and rms residual, grey levels; ``gain``: contrast over the template's; ``kept``:
    share of the points that were used, the others being occluded; ``covariance`` (k, k): of the last δ, for white noise
    of the size of ``residual``; ``left``, ``weight`` (n,): the template's residuals over the gain, and the points'
    weights; ``smear`` (n,): what motion blur adds to the template, which is not part of ``left``.
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
    smear: Floats


class _Now(NamedTuple):
    """Fit at one warp: the picture (side²,) on the template's grid, the solution (k,), and the residuals (n,)."""

    seen: Floats
    found: Floats
    left: Floats

    @property
    def gain(self) -> float:
        """Contrast over the template's."""
        return float(self.found[_GAIN])


class Patch:
    """A template with its derivatives, from its brightness ``look`` at offsets from its middle, px.

    Points ``spacing_px`` apart are compared in a square of half the side ``half_px``, or a disc (``round_``).
    ``freedom`` is the number of parameters of the warp: 2 for the position alone, 6 with rotation, scale and both
    stretches, 8 with the perspective of a plane, for templates so large that it shows. ``soft`` fits the sharpness in
    addition, for drawn templates, which do not include the lens's blur. ``within_px`` is half the side of the inner
    part for which the correlation is also returned separately.
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
        # From rows and columns of the grid to offsets from the middle.
        self._offsets = np.array([[1.0, 0.0, -count], [0.0, 1.0, -count], [0.0, 0.0, 1.0 / spacing_px]])
        self.grid = np.stack([x, y])
        chosen = np.hypot(x, y) <= half_px if round_ else np.ones(len(x), bool)
        self.index = np.flatnonzero(chosen)
        x, y = x[chosen], y[chosen]
        self.generators = _generators(half_px)[:freedom]
        around = np.exp(0.25j * np.pi * np.arange(8)) if round_ else np.array([1 + 1j, 1 - 1j, -1 + 1j, -1 - 1j])
        self.rim = half_px * np.stack([around.real, around.imag])
        self.soft = soft
        self._other = _OTHER_DRAWN if soft else _OTHER_SEEN
        self._share = self._around(np.ones(len(x))) if soft else None
        self._solve_for(look, x, y, soft=soft)
        self._within = (np.abs(x) < within_px) & (np.abs(y) < within_px) if math.isfinite(within_px) else None

    def _solve_for(self, look: Look, x: Floats, y: Floats, *, soft: bool) -> None:
        """Compute the least-squares inverse, and its solution's covariance for white noise."""
        step = 0.5 * self.spacing_px
        middle = look(x, y)
        right, left, down, up = look(x + step, y), look(x - step, y), look(x, y + step), look(x, y - step)
        slope_x, slope_y = (right - left) / (2.0 * step), (down - up) / (2.0 * step)
        softer = (right + left + down + up - 4.0 * middle) / step**2
        columns = [np.ones_like(x), x / self.half_px, y / self.half_px, middle - middle.mean(), *[softer] * soft]
        self._first = len(columns)
        moved = self.generators @ np.stack([x, y, np.ones_like(x)])
        self._along_x, self._along_y = (moved[:, 0] - x * moved[:, 2]).T, (moved[:, 1] - y * moved[:, 2]).T
        self._basis = np.column_stack([*columns, self._columns(slope_x, slope_y)])
        # A codec softens what moves, which would look like a longer exposure.
        self.blurring = self._basis if soft else np.column_stack([self._basis, softer])
        self.look = look
        self.middle = look(*self.grid)
        self._weigh(np.ones(len(x)))
        self.spread = float(self._beside_light(middle, self._trusted).std())

    def _weigh(self, weight: Floats) -> None:
        """Set the points' prior weights (n,) for all following fits."""
        self._trusted, self._inverse = weight, self._inverse_for(weight)
        self._noise = self._overlap(self._inverse)

    def _inverse_for(self, weight: Floats) -> Floats:
        """Return the solution (k, n) of least squares for points of these weights (n,), per unit of brightness."""
        weighted = weight[:, None] * self._basis
        normal = weighted.T @ self._basis
        normal[np.diag_indices_from(normal)] *= 1.0 + 1e-9
        return np.linalg.solve(normal, weighted.T)

    def _beside_light(self, values: Floats, weight: Floats) -> Floats:
        """Return brightness (n,), times the root of the weights (n,), less the light and its gradient."""
        root = np.sqrt(weight)
        light, seen = root[:, None] * self._basis[:, :3], root * values
        return np.asarray(seen - light @ np.linalg.solve(light.T @ light, light.T @ seen))

    @property
    def count(self) -> int:
        """Return the number of points that are compared."""
        return len(self.index)

    @property
    def turns(self) -> bool:
        """Whether rotation, scale and stretches are fitted, not the position alone."""
        return len(self.generators) > 2

    def most_certain(self) -> tuple[tuple[float, float], float]:
        """Return the offset of the point whose position is most certain, and how much less certain the rotation is.

        About that point rotation, scale and stretches leave the picture as it is, as far as they can. The ratio is that
        of the rotation's standard deviation, px at the rim, to that of the position if all of these were known.
        """
        linear, noise = self.generators[2:, :2, :2], self._noise
        square = np.einsum("kia,lib,kl->ab", linear, linear, noise[2:, 2:])
        x, y = (-np.linalg.solve(square, np.einsum("kia,ik->a", linear, noise[:2, 2:]))).tolist()
        least = float(np.linalg.eigvalsh(np.linalg.inv(noise)[:2, :2])[0])
        return (x, y), math.sqrt(float(noise[2, 2]) * least)

    def _overlap(self, inverse: Floats) -> Floats:
        """Return the covariance of δ times gain for residuals of variance 1 from white noise in the picture."""
        # Linear interpolation has a triangle as kernel: two boxes as wide as a pixel, which is halved for a drawn one.
        kernel_px2 = self.blur_px**2 + 2.0 * rounding_variance(0.5 if self.soft else 1.0)
        sigma = math.sqrt(kernel_px2) / self.spacing_px
        rows = np.zeros((len(self.generators), self._side * self._side), np.float32)
        rows[:, self.index] = inverse[self._first :]
        seen = np.stack(
            [
                cv2.GaussianBlur(row.reshape(self._side, -1), (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
                for row in rows
            ]
        ).reshape(len(rows), -1)
        # A sample has 1/(4πσ²) of a pixel's noise variance; samples correlate by the overlap of their kernels.
        return np.asarray(4.0 * math.pi * kernel_px2 / self.spacing_px**2 * (seen @ seen.T), dtype=np.float64)

    def _cut(self, luma: NDArray[np.uint8], warp: Floats) -> _Part:
        """Return the part of a picture around the patch's expected position, blurred for sampling."""
        corners, reach_px = project(warp, self.rim), _REACH * self.spacing_px
        low, high = corners.min(axis=1) - reach_px, corners.max(axis=1) + reach_px
        half = math.ceil(0.5 * float((high - low).max()))
        middle = np.rint(0.5 * (low + high))
        part = cut_out(luma, int(middle[0]), int(middle[1]), half).astype(np.float32)
        blurred = np.asarray(cv2.GaussianBlur(part, (0, 0), self.blur_px), dtype=np.float32)
        if self.soft:
            blurred = cv2.resize(blurred, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_LANCZOS4).astype(np.float32)
        # Limited by both the part and the picture.
        corner = middle - half
        return _Part(blurred, corner, np.maximum(corner, 0.0) - 1.0, np.minimum(middle + half + 1, luma.shape[::-1]))

    def _seen(self, part: _Part, warp: Floats) -> Floats:
        """Return the picture's brightness (m,) at all points of the grid, by linear interpolation."""
        to_part = (_DOUBLED if self.soft else np.eye(3)) @ similarity(*-part.corner) @ warp @ self._offsets
        how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        size = (self._side, self._side)
        seen = cv2.warpPerspective(part.values, to_part, size, flags=how, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(seen, dtype=np.float64).ravel()

    def _round(
        self, part: _Part, warp: Floats, usual: Floats, inverse: Floats, answer: Floats | None
    ) -> tuple[_Now, Floats, float] | None:
        """Return the fit at a warp, the warp after a step, W D⁻¹, and the largest step of a coordinate of the rim, px.

        ``usual`` (n,) are the template's usual residuals over the contrast; ``answer`` (k, k) is the derivative of δ
        with respect to the solution over the contrast. None for a step without contrast, a too large one, or one that
        leaves the part.
        """
        seen = self._seen(part, warp)
        found, by_usual = inverse @ seen[self.index], inverse @ usual
        found -= found[_GAIN] / (1.0 + by_usual[_GAIN]) * by_usual
        left = seen[self.index] - found[_GAIN] * usual - self._basis @ found
        delta = found[self._first :] / found[_GAIN]
        delta = delta if answer is None else answer @ delta
        # The rounding alone has as much contrast; beyond half its width the picture is unknown to the template.
        contrast = abs(found[_GAIN]) * self.spread
        if contrast < SIGMAS * math.sqrt(rounding_variance()) or not np.abs(delta).max() < self.half_px:
            return None
        after = before_step(warp, (delta @ self.generators.reshape(-1, 9)).reshape(3, 3))
        before, rim = (project(one, self.rim).T for one in (warp, after))
        if not ((rim >= part.low) & (rim <= part.high)).all():
            return None
        return _Now(seen, found, left), after, float(np.abs(rim - before).max())

    def align(
        self,
        luma: NDArray[np.uint8],
        warp: Floats,
        learnt: Ink | None = None,
        doubt: Doubt | None = None,
        smear: Smear | None = None,
    ) -> Fit | None:
        """Return the fit of the patch near a first guess; None where it leaves the picture or does not converge."""
        if not self.in_picture(warp, luma):
            return None
        if doubt is not None and doubt.weight is not self._trusted:
            self._weigh(doubt.weight)
        part, blur, answer = self._cut(luma, warp), np.zeros(self.count), None
        for turn in range(_ROUNDS):
            if turn < _MOVED and smear is not None:
                added = smear(warp)
                blur, answer = added[self.index], self._answer(self.middle + added, self._inverse)
            usual = blur if learnt is None else blur + learnt.left
            step = self._round(part, warp, usual, self._inverse, answer)
            if step is None:
                return None
            now, warp, moved = step
            if moved < _STOP * self.spacing_px:
                break
        if moved > 10.0 * _STOP * self.spacing_px:
            return None
        all_known = learnt is not None and np.count_nonzero(learnt.known) > (1.0 - _FEW) * self.count
        # Relative to the scatter of its own residuals, any patch would seem whole, whatever covers it.
        noise = learnt.noise * abs(now.gain) if learnt and all_known else robust_sigma(now.left)
        # Residuals at edges vary between frames, and occluders are wider: points are judged by their surroundings.
        weight = self._weights(now, noise, learnt, np.zeros(self.count, np.bool_))
        seen_whole = np.count_nonzero(weight) > (1.0 - _FEW) * self.count
        if seen_whole and (all_known or learnt is None or not learnt.known.any()):
            return self._fit(now, warp, usual, blur, self._trusted, self._inverse)
        return self._align_in_part(part, warp, now, learnt, usual, blur, answer)

    def _align_in_part(
        self,
        part: _Part,
        warp: Floats,
        now: _Now,
        learnt: Ink | None,
        usual: Floats,
        blur: Floats,
        answer: Floats | None,
    ) -> Fit | None:
        """Continue as a robust fit, in which points that do not show the patch lose their weight.

        The narrow limits of learnt ink would reject every point of a slightly misplaced template: they apply only once
        the fit has nearly converged.
        """
        known = np.zeros(self.count, np.bool_) if learnt is None else learnt.known
        near = learnt is None
        for _ in range(_ROUNDS):
            weight = self._weights(now, robust_sigma(now.left), learnt if near else None, known)
            trust = 1.0 if learnt is None else learnt.trust(now.left / now.gain, weight)
            try:
                inverse = self._inverse_for(trust * weight)
            except np.linalg.LinAlgError:
                return None
            step = self._round(part, warp, usual, inverse, answer)
            if step is None:
                return None
            now, warp, moved = step
            if moved < _STOP * self.spacing_px and near:
                break
            near = near or moved < _STOP * self.spacing_px
        return self._fit(now, warp, usual, blur, weight, inverse)

    def _weights(self, now: _Now, noise: float, learnt: Ink | None, alone: Flags) -> Floats:
        """Return the points' weights (n,) by their residuals, for a drawn template from the mean over surroundings.

        A residual above which a point counts as occluded is smaller where the point's ink is known, ``learnt``. Points
        marked in ``alone`` (n,) are weighted by their own residual in any case.
        """
        gain = abs(now.gain)
        # A codec sends a tag at rest only once: its frames then differ by less than their true errors.
        noise = max(noise, math.sqrt(rounding_variance()))
        limit = np.full(self.count, max(_TUKEY * noise, self._other * self.spread * gain))
        if learnt is not None:
            limit = np.where(learnt.known, _TUKEY * gain * np.sqrt(learnt.variance(noise / gain)), limit)
        beyond = np.square(now.left / limit)
        if self._share is not None and not alone.all():
            beyond = np.where(alone, beyond, self._around(beyond) / self._share)
        return np.asarray(self._trusted * np.square(np.clip(1.0 - beyond, 0.0, None)))

    def _around(self, values: Floats) -> Floats:
        """Return the sum (n,) of values (n,) around every point, with Gaussian weights."""
        grid = np.zeros(self._side * self._side, np.float32)
        grid[self.index] = values
        seen = cv2.GaussianBlur(grid.reshape(self._side, -1), (0, 0), _AROUND, borderType=cv2.BORDER_CONSTANT)
        return np.asarray(seen.ravel()[self.index], dtype=np.float64)

    def _fit(self, now: _Now, warp: Floats, usual: Floats, blur: Floats, weight: Floats, inverse: Floats) -> Fit:
        values, gain = now.seen[self.index] - now.gain * usual, now.gain
        left, plain = np.sqrt(weight) * now.left, self._beside_light(values, weight)
        square, total = float(left @ left), max(float(plain @ plain), 1e-12)
        variance = max(square / max(float(weight.sum()) - len(now.found), 1.0), rounding_variance())
        answer = self._answer(now.seen, inverse)
        noise = self._noise if inverse is self._inverse else self._overlap(inverse)
        return Fit(
            warp=warp,
            likeness=math.copysign(math.sqrt(max(0.0, 1.0 - square / total)), gain),
            inside=math.nan
            if self._within is None
            else _correlation((values - now.left)[self._within], values[self._within]),
            light=float(now.found[_LIGHT]),
            gain=gain,
            residual=math.sqrt(variance),
            kept=float(np.count_nonzero(weight > 0.0)) / len(weight),
            covariance=variance * answer @ noise @ answer.T,
            left=now.left / gain + usual - blur,
            weight=weight,
            smear=blur,
        )

    def _answer(self, seen: Floats, inverse: Floats) -> Floats:
        """Return the derivatives (k, k) of δ with respect to its part of a solution.

        A blurred picture changes less with a shift than the template does: the picture's own gradients give the ratio.
        """
        right, down = _gradient(seen, self._side, self.index) / self.spacing_px
        slope = inverse[self._first :] @ self._columns(right, down)
        # The pseudoinverse, of a picture that shows nothing of a parameter, takes ten times as long.
        return np.asarray(np.linalg.inv(slope) if np.linalg.det(slope) else np.linalg.pinv(slope), dtype=np.float64)

    def _columns(self, slope_x: Floats, slope_y: Floats) -> Floats:
        """Return the derivatives (n, k) of brightness with respect to δ, from its gradient."""
        return np.asarray(slope_x[:, None] * self._along_x + slope_y[:, None] * self._along_y, dtype=np.float64)

    def slope(self, warp: Floats, at: tuple[float, float]) -> Floats:
        """Return the derivatives (2, k), px, of a template point's position in the picture with respect to δ."""
        x, y = at
        moved = self.generators @ np.array([x, y, 1.0])
        inside = np.stack([moved[:, 0] - x * moved[:, 2], moved[:, 1] - y * moved[:, 2]])
        return np.asarray(-jacobian(warp, at) @ inside, dtype=np.float64)

    def in_picture(self, warp: Floats, luma: NDArray[np.uint8]) -> bool:
        """Return whether the whole patch lies in a picture."""
        corners = project(warp, self.rim)
        height, width = luma.shape
        return bool(
            np.isfinite(corners).all()
            and corners.min() > -1.0
            and corners[0].max() < width
            and corners[1].max() < height
        )


@compiled
def _gradient(seen: Floats, side: int, index: Ints) -> Floats:
    """Return the gradient (2, n), to the right and down, at points of a picture (side²,), as numpy's."""
    found = np.empty((2, len(index)))
    for i in range(len(index)):
        row, column = index[i] // side, index[i] % side
        left, right, up, down = max(column - 1, 0), min(column + 1, side - 1), max(row - 1, 0), min(row + 1, side - 1)
        found[0, i] = (seen[row * side + right] - seen[row * side + left]) / (right - left)
        found[1, i] = (seen[down * side + column] - seen[up * side + column]) / (down - up)
    return found


def _generators(half_px: float) -> Floats:
    """Return the generators (8, 3, 3) of the warp: two shifts, rotation, scale, two stretches, two of perspective.

    A unit of each parameter moves the rim by about a pixel.
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


def cut_out(luma: NDArray[np.uint8], cx: int, cy: int, half: int) -> NDArray[np.uint8]:
    """Return the square of half the side ``half`` around a pixel; outside the picture its border is repeated."""
    height, width = luma.shape
    if half <= cx < width - half and half <= cy < height - half:
        return luma[cy - half : cy + half + 1, cx - half : cx + half + 1]
    rows = np.clip(np.arange(cy - half, cy + half + 1), 0, height - 1)
    columns = np.clip(np.arange(cx - half, cx + half + 1), 0, width - 1)
    return luma[np.ix_(rows, columns)]
