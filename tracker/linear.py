"""What a marker is read as, and how it was expected to look.

Uneven light shifts a dot (a slope of 0.1 grey levels per pixel by 0.005 px), but a free slope in every frame costs a
third of the precision, since it looks like an offset. So slopes are measured and averaged over frames, and taken as
known.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple


class View(NamedTuple):
    """How a marker is expected to look just now.

    Attributes
    ----------
    smear_x_px, smear_y_px : float
        Its path during the exposure.
    slope_x, slope_y : float
        Relative change of the light per pixel.
    """

    smear_x_px: float = 0.0
    smear_y_px: float = 0.0
    slope_x: float = 0.0
    slope_y: float = 0.0


STILL: Final = View()
Change = tuple[float, float, float]
SAME: Final[Change] = (0.0, 0.0, 0.0)


@dataclass(slots=True)
class Reading:
    """A marker as read in one picture.

    Attributes
    ----------
    x_px, y_px : float
        Position.
    xx_px2, xy_px2, yy_px2 : float
        Covariance for white noise of the size of ``residual``.
    light : float
        Brightness around the dot (mean brightness for texture), grey levels.
    contrast : float
        Brightness step of the dot relative to the template's (gain for texture); 1 is as expected.
    step : float
        Size of the brightness step, grey levels.
    residual : float
        Root mean square of what the model leaves, grey levels.
    patch : float
        Largest mean over a sector of the window of what the model leaves, grey levels: something lies over it.
    change : (float, float, float)
        How the shape differs from the template's: radius, px, and both terms of stretch; zeros for texture.
    slope : (float, float)
        Slope of the light as seen in this frame alone.
    converged : bool
        Whether the last step was small.
    """

    x_px: float
    y_px: float
    xx_px2: float
    xy_px2: float
    yy_px2: float
    light: float
    contrast: float
    step: float
    residual: float
    patch: float
    change: Change
    slope: tuple[float, float]
    converged: bool
