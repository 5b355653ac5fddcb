"""The rows through which a fit steps: the angle in them is that of stepping through all rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import reference_spec
from torsight.core.records import SyncedTable
from torsight.core.units import DEG
from torsight.discovery.actuator_problem import ActuatorProblem

STEP_S = 0.25
WIRE_S = 60.0


def heating(corners_c, rate_c_s, *, hold_s, share):
    """Return the temperatures of a spring that is driven from 22 °C over corners and then cools, and of its neighbour.

    The corners on the way are held, the last one is not; a ``share`` of the heat reaches the neighbour.
    """
    own = [np.array([22.0])]
    for corner_c in corners_c:
        last = own[-1][-1]
        own.append(np.linspace(last, corner_c, max(2, round(abs(corner_c - last) / rate_c_s / STEP_S) + 1))[1:])
        if hold_s and corner_c != corners_c[-1]:
            own.append(np.full(round(hold_s / STEP_S), corner_c))
    own.append(22.0 + (own[-1][-1] - 22.0) * np.exp(-np.arange(1, 1400) * STEP_S / WIRE_S))
    driven = np.concatenate(own)
    return driven, 22.0 + share * (driven - 22.0)


def problem(
    effect: str | None, *, dip_c: float = 0.0, hold_s: float = 0.0, noise_c: float = 0.0, share: float = 0.0,
    c_m_mpa_per_k: float = 32.0,
) -> tuple[ActuatorProblem, dict[str, float]]:  # fmt: skip
    """Return the problem of a record that the model itself makes, and the values with which it was made."""
    columns: tuple[list, list] = ([], [])
    for k, top_c in enumerate((74.0, 76.0, 64.0, 70.0)):
        corners_c = [60.0, 60.0 - dip_c, top_c] if dip_c + hold_s else [top_c]
        driven, warmed = heating(corners_c, 0.2, hold_s=hold_s, share=share)
        columns[k % 2].append(driven)
        columns[1 - k % 2].append(warmed)
    rng = np.random.default_rng(4)
    a, b = (np.concatenate(column) for column in columns)
    a, b = (one + noise_c * rng.standard_normal(len(one)) for one in (a, b))
    time_s = STEP_S * np.arange(len(a))
    reference = reference_spec()
    spec = replace(reference, values={**reference.values, "C_M_mpa_per_k": c_m_mpa_per_k})
    model = ActuatorModel(spec, ("reference_state", *(() if effect is None else (effect,))))
    values = {"renewal": 1.0} | ({} if effect is None else {"passive_share": 0.6, "heat_leak": 0.0})
    drive = model.prepare(SyncedTable(time_s, np.full(len(a), 177.6 * DEG), np.full(len(a), 0.05 * DEG), a, b))
    angle_rad = model.simulate(drive, values).angle_rad
    table = SyncedTable(time_s, np.interp(time_s, drive.time_s, angle_rad), np.full(len(a), 0.05 * DEG), a, b)
    made = ActuatorProblem(model.prepare(table), spec)
    return made, {p.name: p.value for p in made.parameters} | values


@pytest.mark.parametrize(
    ("effect", "given", "within_deg"),
    [
        (None, {}, 0.01),
        (None, {"dip_c": 1.0}, 0.01),
        (None, {"dip_c": 0.3, "noise_c": 0.05}, 0.02),
        (None, {"hold_s": 12.0, "noise_c": 0.1}, 0.02),
        (None, {"c_m_mpa_per_k": 12.0}, 0.01),
        ("heat_crosstalk", {"share": 0.8}, 0.1),
    ],
    ids=[
        "plain",
        "the temperature dips on its way up",
        "a dip that noise nearly hides",
        "it is held on its way up for too short to see the disk rest",
        "cooling moves the disk at once",
        "the other spring transforms",
    ],
)
def test_steps_between_kept_rows_lead_to_the_angle_of_all_rows(effect, given, within_deg):
    made, values = problem(effect, **given)
    effects = () if effect is None else (effect,)
    whole_deg = made.simulate(values, effects).angle_rad[made.rows] / DEG
    assert len(made.rows) < 0.3 * len(made.drive)
    assert np.sqrt(np.mean((made.predict(values, effects) - whole_deg) ** 2)) < within_deg
