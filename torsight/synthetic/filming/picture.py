"""Drawing, compiled: sticks with their markers, things in front of them, light and noise.

A pixel's share of a shape is that of an edge at the shape's signed distance, blurred by lens and pixel area, with the
edge's curvature to first order. Shapes are described in their plane; each pixel is projected to the plane along its
ray, which gives exact perspective and distortion.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import njit
from torsight.core.units import Floats, Ints

Picture = NDArray[np.float32]

MARGIN_PX = 32
"""Rays are known this far beyond the picture, for a camera that shakes: by 1.5 times the largest shake of a scene file,
20 px, and the pixel beside it. What shakes further is held there."""


@njit(cache=True, nogil=True)
def edge_share(distance_px: float, blur_px: float) -> float:
    """Return the share of a pixel that lies inside an edge; the distance is positive outside."""
    x = distance_px / blur_px
    # Beyond four sigmas an edge is 3e-5 of its step, less than a hundredth of a grey level.
    if x > 4.0:
        return 0.0
    if x < -4.0:
        return 1.0
    return 0.5 * math.erfc(x * math.sqrt(0.5))


@njit(cache=True, nogil=True)
def disc_share(from_centre_px: float, radius_px: float, blur_px: float) -> float:
    """Return the share of a pixel that lies inside a disc: blur draws a bent edge inwards by σ² / 2r."""
    return edge_share(from_centre_px - radius_px + 0.5 * blur_px * blur_px / radius_px, blur_px)


@njit(cache=True, nogil=True)
def plane_point(rays: Floats, plane: Floats, x: float, y: float) -> tuple[float, float]:
    """Return where the ray of a picture point meets a plane, mm; between pixels rays are interpolated linearly."""
    px, py = x + MARGIN_PX, y + MARGIN_PX
    i, j = int(px), int(py)
    fx, fy = px - i, py - j
    rx, ry = rays[j, i, 0], rays[j, i, 1]
    if fx > 0.0 or fy > 0.0:
        a, b, c, d = (1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy
        rx = a * rx + b * rays[j, i + 1, 0] + c * rays[j + 1, i, 0] + d * rays[j + 1, i + 1, 0]
        ry = a * ry + b * rays[j, i + 1, 1] + c * rays[j + 1, i, 1] + d * rays[j + 1, i + 1, 1]
    w = plane[2, 0] * rx + plane[2, 1] * ry + plane[2, 2]
    u = (plane[0, 0] * rx + plane[0, 1] * ry + plane[0, 2]) / w
    v = (plane[1, 0] * rx + plane[1, 1] * ry + plane[1, 2]) / w
    return u, v


@njit(cache=True, nogil=True)
def stick_value(
    below: float, x_mm: float, y_mm: float, turn: tuple[float, float], shape: Floats, scale: Floats, blur_px: float
) -> float:
    """Return the grey level (before light) at a point of a stick's plane, over what is ``below``.

    ``shape``: length, half width, tail, inner, outer, dot radius, stick level, dot level, hub radius, hub level.
    ``scale``: the plane's metric in the picture, d(mm)/d(px) transposed times itself (xx, xy, yy) at three places:
    middle of the stick, inner and outer marker, in the world's axes.
    """
    cos, sin = turn
    u, v = cos * x_mm + sin * y_mm, -sin * x_mm + cos * y_mm
    value = below
    du, dv = max(u - shape[0], -shape[2] - u), abs(v) - shape[1]
    if max(du, dv) < shape[1]:
        along = math.sqrt(scale[0, 0] * cos * cos + 2 * scale[0, 1] * cos * sin + scale[0, 2] * sin * sin)
        across = math.sqrt(scale[0, 0] * sin * sin - 2 * scale[0, 1] * cos * sin + scale[0, 2] * cos * cos)
        share = edge_share(du / along, blur_px) * edge_share(dv / across, blur_px)
        value += share * (shape[6] - value)
        for k in range(2):
            ru, rv = u - shape[3 + k], v
            r = math.sqrt(ru * ru + rv * rv)
            if r < 3.0 * shape[5] + 1e-9:
                n = max(r, 1e-9)
                nx, ny = (cos * ru - sin * rv) / n, (sin * ru + cos * rv) / n
                m = scale[1 + k]
                size = math.sqrt(m[0] * nx * nx + 2 * m[1] * nx * ny + m[2] * ny * ny)
                value += disc_share(r / size, shape[5] / size, blur_px) * (shape[7] - value)
    if shape[8] > 0.0:
        r = math.sqrt(u * u + v * v)
        if r < 2.0 * shape[8]:
            size = math.sqrt(0.5 * (scale[0, 0] + scale[0, 2]))
            value += disc_share(r / size, shape[8] / size, blur_px) * (shape[9] - value)
    return value


@njit(cache=True, nogil=True)
def near_stick(x_mm: float, y_mm: float, turns: Floats, shape: Floats) -> bool:
    """Return whether a point of the plane can be touched by the stick in any of its directions."""
    if x_mm * x_mm + y_mm * y_mm < 4.0 * shape[8] * shape[8]:
        return True
    near = False
    for k in range(turns.shape[0]):
        near |= abs(turns[k, 0] * y_mm - turns[k, 1] * x_mm) < 2.0 * shape[1]
    return near


@njit(cache=True, nogil=True)
def row_spans(hull: Floats, reach_px: float, width: int, first_row: int, rows: int) -> Ints:
    """Return the range of columns (k, 2) of each row inside a convex outline that is widened by ``reach_px``."""
    spans = np.empty((rows, 2), np.int64)
    for row in range(rows):
        low, high = 1e9, -1e9
        for i in range(hull.shape[0]):
            px, py = hull[i]
            qx, qy = hull[(i + 1) % hull.shape[0]]
            top, bottom = first_row + row - reach_px, first_row + row + reach_px
            if max(py, qy) < top or min(py, qy) > bottom:
                continue
            for edge in (top, bottom):
                t = 0.0 if py == qy else min(max((edge - py) / (qy - py), 0.0), 1.0)
                x = px + t * (qx - px)
                low, high = min(low, x), max(high, x)
        spans[row, 0] = max(math.floor(low - reach_px), 0)
        spans[row, 1] = max(min(math.ceil(high + reach_px) + 1, width), spans[row, 0])
    return spans


class Canvas(NamedTuple):
    """A picture under construction: grey levels (h, w), changed in place, and the relative light.

    ``rays`` (h + 2 m, w + 2 m, 2) are those of every pixel, with a margin m of :data:`MARGIN_PX`; ``shift_px`` is by
    how much the picture has moved, ``blur_px`` the blur of an edge.
    """

    picture: Picture
    light: Picture
    rays: Floats
    shift_px: Floats
    blur_px: float


class Stick(NamedTuple):
    """A stick in its plane: the homography (3, 3) from rays to the plane, mm, and what :func:`stick_value` draws.

    ``turns`` (n, 2) are cosine and sine of the directions that it takes while the shutter is open.
    """

    plane: Floats
    turns: Floats
    shape: Floats
    scale: Floats


@njit(cache=True, nogil=True)
def draw_stick(canvas: Canvas, stick: Stick, first_row: int, spans: Ints) -> None:
    """Draw a stick into a picture, averaged over its directions.

    Only the pixels of ``spans`` (k, 2; first and last x, :func:`row_spans`) are drawn, from the first row on.
    """
    picture, light, rays, shift_px, blur_px = canvas
    plane, turns, shape, scale = stick
    for row in range(spans.shape[0]):
        y = first_row + row
        for x in range(spans[row, 0], spans[row, 1]):
            x_mm, y_mm = plane_point(rays, plane, x - shift_px[0], y - shift_px[1])
            if not near_stick(x_mm, y_mm, turns, shape):
                continue
            below = picture[y, x] / light[y, x]
            total = 0.0
            for k in range(turns.shape[0]):
                total += stick_value(below, x_mm, y_mm, (turns[k, 0], turns[k, 1]), shape, scale, blur_px)
            picture[y, x] = light[y, x] * total / turns.shape[0]


@njit(cache=True, nogil=True)
def draw_bar(picture: Picture, light: Picture, ends_px: Floats, radius_px: float, level: float, blur_px: float) -> None:
    """Draw a bar with round ends over the picture: a hand, a wire, or (both ends in one place) an LED."""
    ax, ay, bx, by = ends_px
    height, width = picture.shape
    reach = radius_px + 5.0 * blur_px
    x0, x1 = max(int(min(ax, bx) - reach), 0), min(int(max(ax, bx) + reach) + 1, width)
    y0, y1 = max(int(min(ay, by) - reach), 0), min(int(max(ay, by) + reach) + 1, height)
    length2 = (bx - ax) ** 2 + (by - ay) ** 2
    for y in range(y0, y1):
        for x in range(x0, x1):
            t = 0.0
            if length2 > 0.0:
                t = min(max(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length2, 0.0), 1.0)
            dx, dy = x - ax - t * (bx - ax), y - ay - t * (by - ay)
            share = edge_share(math.sqrt(dx * dx + dy * dy) - radius_px, blur_px)
            if share > 0.0:
                picture[y, x] += share * (level * light[y, x] - picture[y, x])


@njit(cache=True, nogil=True)
def expose(
    picture: Picture, gain: np.float32, read: np.float32, shot: np.float32, noise: Picture, out: NDArray[np.uint8]
) -> None:
    """Turn light into 8-bit grey levels: gain, shot and read noise (one normal number per pixel), rounding."""
    half, top, none = np.float32(0.5), np.float32(255.0), np.float32(0.0)
    flat, levels = picture.reshape(-1), out.reshape(-1)
    for i in range(flat.size):
        value = max(gain * flat[i], none)
        value += np.sqrt(read * read + shot * value) * noise[i] + half
        levels[i] = np.uint8(min(max(value, none), top))
