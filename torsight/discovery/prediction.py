"""Predictions of a discovered model, the learned stand-in included."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.fitted import FittedModel
from torsight.core.records import TemperatureLog
from torsight.discovery.closure import correction_rad


def predict_angle(model: FittedModel, log: TemperatureLog, *, start_angle_rad: float) -> NDArray[np.float64]:
    """Return the angle (n,) in radians at the instants of a later temperature log, as a camera would read it."""
    prediction = model.predict(log, start_angle_rad=start_angle_rad)
    if model.closure is None:
        return prediction.angle_rad
    return np.asarray(prediction.angle_rad + correction_rad(model.closure, prediction.drive, prediction.simulation))
