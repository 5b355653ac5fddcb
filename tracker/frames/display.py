"""From a decoded frame to the brightness of the picture that a player shows.

A container's display matrix may demand that its frames are rotated by quarter turns or mirrored before they are shown
(a phone held upright, a front camera). An interlaced frame holds two instants, one in its even rows and one in its odd
rows; objects that move between them show a comb. From such a frame only the field that is shown first is used, and the
rows of the other field are interpolated: half the vertical resolution, but one instant per frame.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Luma = NDArray[np.uint8]

# Formats whose first plane is the luma, one byte per pixel.
_PLANAR: Final = ("yuv4", "yuvj4", "yuva4", "gray", "nv12", "nv21", "nv16", "nv24")
# Formats whose first plane is the luma in the low bits of two bytes.
_DEEP: Final = {"10le": 2, "12le": 4, "14le": 6, "16le": 8}
_BOTTOM_FIRST: Final = (3, 4)
"""AVFieldOrder of FFmpeg's codec_par.h: BB, and TB (coded top first, shown bottom first)."""
_TRANSFERS: Final = {16: "pq", 18: "hlg"}
"""Transfer functions of high dynamic range by their number in ITU-T H.273: SMPTE ST 2084, ARIB STD-B67."""


@dataclass(frozen=True, slots=True)
class Display:
    """Transform from rows and columns as stored to those shown: transposed, then mirrored along x and y.

    ``bottom_first``: the odd rows of an interlaced frame are shown first.
    """

    transposed: bool = False
    mirror_x: bool = False
    mirror_y: bool = False
    bottom_first: bool = False

    @property
    def mirrored(self) -> bool:
        """Whether the picture shown is a mirror image, in which every rotation is reversed."""
        return self.transposed ^ self.mirror_x ^ self.mirror_y

    @property
    def rotation_deg(self) -> int:
        """Rotation as shown, counter-clockwise; for a mirror image, before it is mirrored left to right."""
        left_right = self.mirror_x ^ self.mirrored
        if self.transposed:
            return 270 if left_right else 90
        return 180 if left_right else 0

    def describe(self) -> dict[str, Any]:
        """Return rotation and mirroring, where there are any, for ``track.json``."""
        about: dict[str, Any] = {}
        if self.rotation_deg:
            about["rotation_deg"] = self.rotation_deg
        if self.mirrored:
            about["mirrored"] = True
        return about


def display_of(frame: Any, codec: Any) -> Display:
    """Return the display transform of a decoded frame, from its display matrix and its codec's field order.

    The matrix (ISO/IEC 14496-12, 6.2.2; 16.16 fixed point, columns before rows) maps x, y as stored to a x + c y, b
    x + d y as shown. A rotation is rounded to the nearest quarter turn: the angle between two sticks does not depend on
    the rest.
    """
    bottom_first = int(codec.field_order) in _BOTTOM_FIRST
    matrix = next((bytes(data) for data in frame.side_data if data.type.name == "DISPLAYMATRIX"), None)
    if matrix is None:
        return Display(bottom_first=bottom_first)
    # Side data is in the byte order of the machine.
    a, b, _, c, d = np.frombuffer(matrix, np.int32)[:5].tolist()
    if abs(a) + abs(d) >= abs(b) + abs(c):
        return Display(mirror_x=a < 0, mirror_y=d < 0, bottom_first=bottom_first)
    return Display(transposed=True, mirror_x=c < 0, mirror_y=b < 0, bottom_first=bottom_first)


def transfer_of(frame: Any) -> str | None:
    """Return ``"pq"`` or ``"hlg"`` for a frame of high dynamic range."""
    return _TRANSFERS.get(int(frame.color_trc))


def luma_of(frame: Any, display: Display) -> Luma:
    """Return the brightness of a frame as shown, a view of the decoder's memory where possible."""
    name = frame.format.name
    bits = _bits_below(name)
    if bits == 0:
        plane = frame.planes[0]
        rows = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)
        luma = rows[: frame.height, : frame.width]
    elif bits is not None:
        plane = frame.planes[0]
        deep = np.frombuffer(plane, "<u2").reshape(-1, plane.line_size // 2)
        luma = (deep[: frame.height, : frame.width] >> bits).astype(np.uint8)
    else:
        luma = frame.to_ndarray(format="gray")
    if frame.interlaced_frame:
        luma = first_field(luma, bottom=display.bottom_first)
    return _shown(luma, display)


class Closed:
    """Makes pictures contiguous in memory; each result is valid only until the next one.

    Rows with gaps are another type to the compiler, for which every function that reads a picture would be compiled
    again. The buffer is reused: new memory costs ten times the copy.
    """

    def __init__(self) -> None:
        self._room: Luma = np.empty((0, 0), np.uint8)

    def __call__(self, luma: Luma) -> Luma:
        """Return the picture itself where it is contiguous, else a copy in the buffer."""
        if luma.flags.c_contiguous:
            return luma
        if self._room.shape != luma.shape:
            self._room = np.empty_like(luma, order="C")
        np.copyto(self._room, luma)
        return self._room


def first_field(luma: Luma, *, bottom: bool) -> Luma:
    """Return a picture with the rows of one field, and the means of their neighbours as the rows between them."""
    first = int(bottom)
    field = luma[first::2]
    whole = np.empty_like(luma, order="C")
    whole[first::2] = field
    between = ((field[:-1].astype(np.uint16) + field[1:] + 1) >> 1).astype(np.uint8)
    whole[first + 1 :: 2][: len(between)] = between
    # The row before the first one of the field, and the one after its last, have one neighbour.
    if bottom:
        whole[0] = field[0]
    if (len(luma) - first) % 2 == 0:
        whole[-1] = field[-1]
    return whole


def _shown(luma: Luma, display: Display) -> Luma:
    if not (display.transposed or display.mirror_x or display.mirror_y):
        return luma
    turned = luma.T if display.transposed else luma
    step_y, step_x = (-1 if flip else 1 for flip in (display.mirror_y, display.mirror_x))
    return np.ascontiguousarray(turned[::step_y, ::step_x])


@functools.cache
def _bits_below(name: str) -> int | None:
    """Return the number of bits of a pixel format's luma beyond eight; None where luma has no plane of its own."""
    if name.startswith(_PLANAR) and not name.endswith(("le", "be")) and name not in ("gray16", "gray10"):
        return 0
    return _DEEP.get(name[-4:]) if name.startswith(("yuv4", "gray1")) else None
