"""The four spring tests: values back from logs made with formulas of their own, files, refusals."""

from __future__ import annotations

import json

import numpy as np
import pytest
from actuator_programmes import programme
from spring_bench import Spring, true_values, write_bench

from torsight.actuator.characterising.characterisation import characterise
from torsight.actuator.characterising.curve_fit import fit_curve
from torsight.actuator.characterising.spring_tests import read_tests
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import read_actuator
from torsight.cli.characterise import characterise as command
from torsight.cli.fit import fit_to_folder
from torsight.core.errors import ConfigError, InputError
from torsight.core.files.storage import read_table, write_table
from torsight.core.files.tables import write_merged
from torsight.core.parameter import Parameter
from torsight.core.records import SyncedTable


def test_without_noise_the_values_come_back(tmp_path):
    spring = Spring(
        e_a=55.0, e_m=22.0, e_s=4.0, a_s=34.0, a_f=57.0, m_s=44.0, m_f=30.0, c_a=28.0, c_m=24.0, theta_cr=160.0
    )
    found = characterise(read_tests(write_bench(tmp_path, spring=spring, rows=400)))
    for name, true in true_values(spring).items():
        assert found.estimates[name].value == pytest.approx(true, rel=2e-3), name
    assert found.better_law == "liang_rogers"


def test_with_the_papers_noise_the_errors_are_the_papers(tmp_path):
    found = characterise(read_tests(write_bench(tmp_path, rng=np.random.default_rng(7), rows=600)))
    # Scatter of 600 to 1200 rows is good to 4 %.
    expected = {"free_recovery": 9.5752, "block_heating": 0.0227, "block_cooling": 0.0125}
    for name, rmse in expected.items():
        assert found.steps[name].rmse == pytest.approx(rmse, rel=0.1)
    assert found.steps["free_recovery_tanaka"].rmse > found.steps["free_recovery"].rmse
    for name, true in true_values(Spring()).items():
        low, high = found.estimates[name].ci95
        # Twice the interval is four sigmas; the influence of stress has an interval that is not symmetric.
        assert low - (high - low) / 2 < true < high + (high - low) / 2, name


def test_command_writes_what_fit_takes(tmp_path):
    command(write_bench(tmp_path / "logs", rng=np.random.default_rng(1), rows=300), out=tmp_path / "out")
    spec = read_actuator(tmp_path / "out" / "actuator.toml")
    assert set(spec.uncertainty) == set(true_values(Spring()))
    result = fit_to_folder(_record(spec, tmp_path), tmp_path / "out" / "actuator.toml", out=tmp_path / "fit")
    assert result.converged
    assert {*true_values(Spring()), "tau_c_mnm", "zero_deg"} <= set(result.free)
    content = json.loads((tmp_path / "out" / "characterisation.json").read_text())
    assert content["schema"] == 1
    assert content["phase_law"]["better"] == "liang_rogers"
    assert set(content["steps"]) >= {
        "free_recovery",
        "free_recovery_tanaka",
        "force_angle",
        "block_heating",
        "block_cooling",
    }
    for name in content["figures"]:
        assert (tmp_path / "out" / name).stat().st_size > 5000


def _record(spec, folder):
    """Write what a rig with these values does, with a friction of its own."""
    log, _ = programme([(0, [(85.0, 1.0)]), (1, [(85.0, 1.0)])])
    model = ActuatorModel(spec)
    angle = model.simulate(model.prepare_log(log, start_angle_rad=2.9), {"tau_c_mnm": 0.9}).angle_rad
    angle = angle + 1e-3 * np.random.default_rng(0).standard_normal(len(log))
    write_merged(
        folder / "merged.csv",
        SyncedTable(log.time_s, angle, np.full(len(log), 1e-3), log.temp_a_c, log.temp_b_c, log.heat_a, log.heat_b),
    )
    return folder / "merged.csv"


@pytest.mark.parametrize(
    ("name", "column", "factor", "told"),
    [
        ("recovery_118.csv", "temp_c", 0.0, "is not heated"),
        ("recovery_118.csv", "angle_deg", 0.017, "does not recover"),
        ("block.csv", "temp_c", 0.0, "has no heating"),
        ("block.csv", "force_n", 0.0, "no spring"),
        ("block.csv", "force_n", 1e3, "newtons"),
        ("large.csv", "force_n", 1e3, "slopes of force against angle"),
    ],
)
def test_logs_that_are_no_tests_of_a_spring(tmp_path, name, column, factor, told):
    path = write_bench(tmp_path, rows=60)
    frame = read_table(tmp_path / name)
    frame[column] = frame[column] * factor
    write_table(tmp_path / name, {str(key): frame[key].to_numpy() for key in frame.columns})
    with pytest.raises(InputError, match=told):
        characterise(read_tests(path))


@pytest.mark.parametrize(
    ("old", "new", "kind", "told"),
    [
        ("lever_mm", "mean_diameter_mm = 9\nlever_mm", ConfigError, "both determine the length"),
        ('range = "large"', 'range = "huge"', ConfigError, "huge"),
        ('range = "large"', 'range = "small"', ConfigError, 'range = "large"'),
        ("lever_mm = 26.4", "lever = 26.4", ConfigError, "lever_mm"),
        ("pre_deformation_deg = -118.0", "pre_deformation_deg = 0.0", ConfigError, "pre_deformation_deg"),
        ('file = "block.csv"', 'file = "blok.csv"', InputError, "block.csv"),
        ("[friction]\ntau_c_mnm = 0.8\n", "", ConfigError, "friction"),
        ('range = "small"', 'range = "small"\nfrom_deg = -900\nto_deg = -800', InputError, "too few rows"),
    ],
)  # fmt: skip
def test_refusals(tmp_path, old, new, kind, told):
    path = write_bench(tmp_path, rows=60)
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(kind, match=told):
        read_tests(path)


def test_a_block_test_without_cooling_is_refused(tmp_path):
    path = write_bench(tmp_path, rows=60)
    lines = (tmp_path / "block.csv").read_text().splitlines()
    (tmp_path / "block.csv").write_text("\n".join(lines[:61]) + "\n")
    with pytest.raises(InputError, match="has no cooling"):
        characterise(read_tests(path))


def test_curve_fit_counts_correlation_and_priors():
    """A mean of correlated values: the sigma is that of the independent ones among them."""
    rng = np.random.default_rng(0)
    keep, sizes = 0.9, []
    for _ in range(120):
        noise = np.empty(800)
        noise[0] = rng.standard_normal() / np.sqrt(1 - keep**2)
        steps = rng.standard_normal(800)
        for k in range(1, 800):
            noise[k] = keep * noise[k - 1] + steps[k]
        found = fit_curve(lambda v: np.full(800, v["mean"]), [Parameter("mean", 0.5, "")], noise)
        sizes.append(found.values["mean"] / found.estimates["mean"].sigma)
    # 120 draws of a standard normal have an rms of 1 ± 0.065; the correlation time is itself estimated.
    assert 0.8 < np.sqrt(np.mean(np.square(sizes))) < 1.35
    held = fit_curve(
        lambda v: np.full(50, v["mean"]), [Parameter("mean", 2.0, "", sigma=1e-3)], rng.standard_normal(50)
    )
    assert held.values["mean"] == pytest.approx(2.0, abs=4e-3)
