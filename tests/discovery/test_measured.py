"""The engine on measurements that nobody of this project made."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from tests.scripts import script
from torsight.discovery import Findings, find_missing, law
from torsight.discovery.linear_problem import LinearProblem, linear_problem

pytestmark = pytest.mark.shared_data


@pytest.fixture(scope="module")
def emps() -> ModuleType:
    return script("examples/emps.py")


def test_linear_drive_lacks_friction_that_differs_by_direction(emps: ModuleType, shared_data: Path) -> None:
    findings, record, later = emps.discover_drive(shared_data / "emps")
    base, chosen = findings.field.base, findings.decision.chosen
    single = next(one for one in findings.ranked(1) if one.effects)
    assert single.effects == ("friction_by_direction",)
    # Published: M 95.1089 kg, Fv 203.5034 N s/m, Fc 20.3935 N, offset −3.1648 N; 4.0834 % and 3.1117 %.
    published = {"mass_kg": 95.1089, "viscous_n_s_per_m": 203.5034, "coulomb_n": 20.3935, "offset_n": -3.1648}
    for name, value in published.items():
        assert base.fit.values[name] == pytest.approx(value, rel=3e-3)
    assert emps.relative_error(record, base) == pytest.approx(0.040834, rel=0.01)
    assert emps.relative_error(record, single) == pytest.approx(0.031117, rel=0.01)
    assert emps.relative_error(later, single) < 0.97 * emps.relative_error(later, base)
    # A law of speed explains more than that form does, here and on the record that no fit has seen.
    assert findings.verdict == "unknown"
    assert findings.drivers[0][0] == "speed"
    assert emps.relative_error(record, chosen) < 0.9 * emps.relative_error(record, single)
    assert emps.relative_error(later, chosen) < emps.relative_error(later, single)


def test_friction_over_speed_is_measured_without_a_form(emps: ModuleType, shared_data: Path) -> None:
    record, later = (emps.read_drive(shared_data / "emps" / f"DATA_EMPS{end}.mat") for end in ("", "_PULSES"))
    found = emps.measure_friction(record)
    assert found.verdict == "unknown"
    assert [name for name, _ in found.drivers] == ["speed"]
    # The law holds the published form (friction by direction, 3.1117 %) up to lines between its nodes.
    assert relative(found, record, emps) < 1.02 * 0.031117
    assert relative(found, later, emps) < 0.97 * emps.relative_error(later, found.field.base)
    (curve,) = found.laws
    assert curve.id == "friction_n"
    assert curve.chosen
    assert curve.covered.all()


def relative(found: Findings, drive: Any, emps: ModuleType) -> float:
    left = drive.force_n - found.predict(emps.table_of(drive))["force_n"]
    return float(np.linalg.norm(left) / np.linalg.norm(drive.force_n))


def test_strain_of_an_alloy_over_stress_is_a_curve_that_saturates(shared_data: Path) -> None:
    """Four stresses, each held out once: what the other three say of it. The law alone, then with forms."""
    example = script("examples/sma_stress.py")
    folder = shared_data / "sma_react" / "isobaric"
    bare = example.discover(folder, candidates=())
    assert bare.verdict == "unknown"
    assert [name for name, _ in bare.drivers] == ["stress"]
    (curve,) = bare.laws
    # It grows with the stress, and less and less.
    rises = np.diff(curve.values)
    assert (rises > 0.0).all()
    assert rises[-3:].sum() < 0.5 * rises[:3].sum()
    found = example.discover(folder)
    # A tenth of a per cent of strain is left, fifteen times what neighbouring readings scatter by.
    assert (found.verdict, found.effects) == ("unknown", ("saturating",))
    assert found.forms_taken == ()
    before, after = found.errors["strain_pct"]
    assert after.rmse_held_out < 0.5 * before.rmse_held_out


@pytest.mark.parametrize("nodes", [4, 24])
def test_that_curve_hangs_on_no_number_of_nodes(shared_data: Path, monkeypatch: pytest.MonkeyPatch, nodes: int) -> None:
    """The plain model's values are pulled off by the missing curve: from there alone no law of four nodes finds it."""
    example = script("examples/sma_stress.py")
    monkeypatch.setattr(example, "MORE", law("more_pct", driver="stress", nodes=nodes))
    before, after = example.discover(shared_data / "sma_react" / "isobaric", candidates=()).errors["strain_pct"]
    assert after.rmse_held_out < 0.7 * before.rmse_held_out


def test_wire_under_constant_stress_moves_from_cycle_to_cycle(shared_data: Path) -> None:
    problem = _loops(shared_data / "sma_react" / "isobaric_7cycle.txt")
    findings = find_missing(problem)
    assert "cycle_drift" in findings.decision.chosen.effects
    base, chosen = findings.before, findings.after
    assert base is not None
    assert chosen is not None
    assert chosen.rms < 0.5 * base.rms


def test_without_a_name_the_drift_is_still_traced_to_the_cycle(shared_data: Path) -> None:
    problem = _loops(shared_data / "sma_react" / "isobaric_7cycle.txt", nameless=True)
    findings = find_missing(problem)
    assert findings.verdict == "unknown"
    assert findings.drivers[0][0] == "cycle"


def _loops(path: Path, *, nameless: bool = False) -> LinearProblem:
    """Extension over temperature at 2400 MPa: one curve for heating and one for cooling, the same in every cycle."""
    rows = []
    for line in path.read_text(encoding="latin-1").splitlines():
        fields = line.strip().strip('"').split(",")
        if len(fields) == 6 and fields[0].replace(".", "").isdigit():
            rows.append([float(field) for field in fields])
    time_h, _, _, temp_c, extension_mm, stress_mpa = np.array(rows).T
    loaded = np.flatnonzero(stress_mpa > 2300.0)
    time_h, temp_c, extension_mm = time_h[loaded], temp_c[loaded], extension_mm[loaded]
    smooth = np.convolve(np.pad(temp_c, 4, mode="edge"), np.ones(9) / 9.0, mode="valid")
    heating = np.gradient(smooth) > 0.0
    lows = [
        int(np.argmin(np.where((time_h > t) & (time_h < t + 0.8), temp_c, np.inf))) for t in np.arange(7) * 0.775 + 0.2
    ]
    cycle = np.searchsorted(np.array(lows), np.arange(len(temp_c)))
    knots = np.linspace(-30.0, 51.0, 9)
    hats = np.column_stack([np.interp(temp_c, knots, row) for row in np.eye(len(knots))])
    base = {
        f"{way}_{i}": hats[:, i] * on for way, on in (("up", heating), ("down", ~heating)) for i in range(len(knots))
    }
    late = cycle.astype(float)
    candidates = {
        "rate": {"rate": np.gradient(smooth)},
        "hold": {"hold": np.exp(-np.abs(temp_c + 30.0))},
    }
    if not nameless:
        # Settles with the cycles by amounts that change over the temperature, heating and cooling apart.
        fall = 1.0 - np.exp(-late / 2.0)
        coarse = [np.interp(temp_c, [-30.0, 10.0, 51.0], row) for row in np.eye(3)]
        candidates["cycle_drift"] = {
            f"settled_{way}_{i}": fall * column * on
            for way, on in (("up", heating), ("down", ~heating))
            for i, column in enumerate(coarse)
        }
    return linear_problem(
        extension_mm,
        base,
        candidates,
        time_s=3600.0 * time_h,
        block=np.clip(cycle, 0, 7).astype(np.int64),
        drivers={"temp_active_c": temp_c, "cycle": late, "direction": np.where(heating, 1.0, -1.0)},
        sigma=0.0,
        resolution=0.05,
    )
