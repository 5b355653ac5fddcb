"""Camera calibration with boards: lenses with uncertainty, stereo pairs, the pose of the rotation axis.

In: pictures or films of a board of known size (mm). Out: a :class:`~torsight.core.optics.camera.Camera` (px, rad, mm)
with the uncertainty of every value, and a verdict on it. :mod:`calibration.boards` describes and prints boards,
:mod:`calibration.views` finds their corners in pictures, :mod:`calibration.cameras` fits lenses and pairs,
:mod:`calibration.axis` the rotation axis, :mod:`calibration.quality` judges the result; ``stage`` runs all of it.
"""

from __future__ import annotations

from torsight.core.lazy import lazily

__getattr__, __dir__ = lazily(__name__, __file__)
