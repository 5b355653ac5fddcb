"""``torsight paper``, ``simulate``, ``predict`` and ``fit`` from file to file."""

from __future__ import annotations

import json

import numpy as np
import pytest
from actuator_programmes import programme

from tests.command_line import leave
from torsight.actuator.model import ActuatorModel
from torsight.actuator.record.logs import read_log
from torsight.actuator.spec import reference_spec
from torsight.cli.fit import fit
from torsight.cli.predict import predict
from torsight.cli.simulate import simulate
from torsight.core.errors import InputError
from torsight.core.files.storage import read_table, write_table, write_text
from torsight.core.files.tables import write_merged
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.core.series import rms
from torsight.core.units import DEG

HALVES = [(0, [(75.0, 0.3)]), (1, [(62.0, 0.4)]), (0, [(80.0, 0.6)])]


def actuator_file(folder):
    tables = reference_spec().to_tables()
    text = "".join(
        f"[{name}]\n" + "".join(f"{key} = {value}\n" for key, value in table.items()) for name, table in tables.items()
    )
    write_text(folder / "actuator.toml", text)
    return folder / "actuator.toml"


def temps_file(folder, suffix=".csv", halves=HALVES):
    log, _ = programme(halves)
    path = folder / f"temps{suffix}"
    write_table(
        path,
        {"time_s": log.time_s + 1000.0, "temp_a_c": log.temp_a_c, "temp_b_c": log.temp_b_c, "note": ["x"] * len(log)},
    )
    return path, log


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_simulate_answers_every_row(tmp_path, suffix):
    temps, log = temps_file(tmp_path, suffix)
    out = tmp_path / f"angles{suffix}"
    simulate(actuator_file(tmp_path), temps, start_angle=170.0, out=out)
    table = read_table(out, required=("time_s", "angle_deg"))
    model = ActuatorModel(reference_spec())
    expected = model.simulate(model.prepare_log(log, start_angle_rad=170.0 * DEG)).angle_rad / DEG
    assert np.array_equal(table["time_s"].to_numpy(), log.time_s + 1000.0)
    # CSV keeps ten digits; with switches or without, the same half-cycles.
    assert table["angle_deg"].to_numpy() == pytest.approx(expected, abs=1e-6)
    assert (table["note"] == "x").all()


def test_simulate_finds_the_tops_between_readings_that_are_seconds_apart(tmp_path):
    time_s = np.arange(0.0, 800.0, 0.1)

    def heated(begins_s, tops_c):
        """Return a wire that is heated along ramps of a minute, not to the end, and cools by itself."""
        above = [
            (top_c - 23.0)
            * np.minimum(np.clip(since_s / 60.0, 0.0, 1.0), np.exp(np.minimum((60.0 - since_s) / 30.0, 0.0)))
            for since_s, top_c in zip((time_s - begin_s for begin_s in begins_s), tops_c, strict=True)
        ]
        return 23.0 + np.maximum(*above)

    fine = TemperatureLog(time_s, heated((20.3, 420.3), (52.0, 55.0)), heated((220.7, 620.7), (53.0, 54.0)))
    model = ActuatorModel(reference_spec())
    true_deg = model.simulate(model.prepare_log(fine, start_angle_rad=3.1)).angle_rad / DEG
    every = 31
    columns = {"time_s": time_s, "temp_a_c": fine.temp_a_c, "temp_b_c": fine.temp_b_c}
    write_table(tmp_path / "slow.csv", {name: values[::every] for name, values in columns.items()})
    simulate(actuator_file(tmp_path), tmp_path / "slow.csv", start_angle=3.1 / DEG, out=tmp_path / "angles.csv")
    off_deg = read_table(tmp_path / "angles.csv")["angle_deg"].to_numpy() - true_deg[::every]
    # Where each top is taken as its highest reading, up to half a reading below it, the angle errs by 5.7°.
    assert rms(off_deg) < 1.0


def test_simulate_reads_the_log_of_an_instrument(tmp_path, capsys):
    temps, log = temps_file(tmp_path)
    simulate(actuator_file(tmp_path), temps, start_angle=170.0, out=tmp_path / "plain.csv")
    text = read_table(temps).set_axis(["Time", "T1 (°C)", "T2 (°C)", "note"], axis=1).to_csv(index=False, sep=";")
    (tmp_path / "log.txt").write_text(f"logger 3\n\n{text}", encoding="utf-8")
    simulate(
        tmp_path / "actuator.toml",
        tmp_path / "log.txt",
        start_angle=170.0,
        out=tmp_path / "named.csv",
        columns="a=T1,b=T2",
    )
    assert (tmp_path / "named.csv").read_bytes() == (tmp_path / "plain.csv").read_bytes()
    assert "time from 'Time'" in capsys.readouterr().err
    assert len(log) == len(read_table(tmp_path / "named.csv"))


def test_a_log_with_a_row_of_too_many_fields_is_not_answered(tmp_path):
    (tmp_path / "t.csv").write_text("time_s,temp_a_c,temp_b_c\n0,24,24\n1,24,24,7,8\n2,24,24\n")
    with pytest.raises(InputError, match=r"there can be no result.*first on line 3"):
        read_log(tmp_path / "t.csv")


def test_fit_then_predict(tmp_path):
    _, log = temps_file(tmp_path)
    truth = ActuatorModel(reference_spec())
    values = {"tau_c_mnm": 0.95, "A_s_c": 36.4}
    angle = truth.simulate(truth.prepare_log(log, start_angle_rad=3.0), values).angle_rad
    noisy = angle + 1e-3 * np.random.default_rng(0).standard_normal(len(log))
    merged = tmp_path / "merged.csv"
    write_merged(merged, SyncedTable(log.time_s, noisy, np.full(len(log), 1e-3), log.temp_a_c, log.temp_b_c))
    fit(merged, actuator=actuator_file(tmp_path), out=tmp_path / "out")
    content = json.loads((tmp_path / "out" / "fit.json").read_text())
    tau = content["parameters"]["tau_c_mnm"]
    assert tau["ci95"][0] < 0.95 < tau["ci95"][1]
    later, other = temps_file(tmp_path, halves=[(0, [(58.0, 0.2)]), (1, [(79.0, 0.3)])])
    predict(tmp_path / "out" / "model.json", later, start_angle=170.0, out=tmp_path / "p.csv")
    expected = truth.simulate(truth.prepare_log(other, start_angle_rad=170.0 * DEG), values).angle_rad / DEG
    found = read_table(tmp_path / "p.csv", required=("angle_deg",))["angle_deg"].to_numpy()
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.3


@pytest.mark.parametrize(
    ("column", "row", "value", "told"),
    [
        ("temp_a_c", 5, 350.0, "row 7, column temp_a_c"),
        ("time_s", 9, 1000.0, "does not increase"),
        ("temp_b_c", 3, "hot", "row 5"),
    ],
)
def test_logs_that_cannot_be_used(tmp_path, column, row, value, told):
    temps, _ = temps_file(tmp_path)
    frame = read_table(temps).astype({column: object})
    frame.loc[row, column] = value
    frame.to_csv(temps, index=False)
    with pytest.raises(InputError, match=told):
        read_log(temps)


def test_paper(tmp_path):
    assert leave("paper", "--out", tmp_path) == 0
    content = json.loads((tmp_path / "paper.json").read_text())
    numbers = content["numbers"]
    assert numbers["range"]["ours"] == pytest.approx(466.0, abs=0.5)
    assert numbers["temperature_of_the_extremum"]["ours"] == pytest.approx(70.0, abs=0.1)
    wanted = ("04", "05", "07", "09", "10", "11", "12a", "12b", "15", "16", "17")
    for number in wanted:
        assert any(name.startswith(f"figure_{number}_") for name in content["figures"])
    for name in content["figures"]:
        assert (tmp_path / name).stat().st_size > 5000
