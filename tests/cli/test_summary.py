"""The end of a run in plain words: what is not explained comes before what is named."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from made_up_run import discovery, made_up_law, write_made_up_run

from torsight.cli.run import answer_of
from torsight.cli.summary import summary

AFTER = {"rmse_train_deg": 0.05, "r2_held_out": 0.9999}


def lines(folder: Path, left_deg: float) -> list[str]:
    write_made_up_run(folder, rate_hz=1.0)
    content = discovery() | {"after": AFTER | {"rmse_held_out_deg": left_deg}, "laws": [made_up_law().to_json()]}
    content["evidence"] = {"over_floor_after": left_deg / content["noise_floor_deg"]}
    (folder / "discovery.json").write_text(json.dumps(content), encoding="utf-8")
    return summary(folder)


@pytest.mark.parametrize(("left_deg", "explained"), [(0.119, True), (0.121, False)])
def test_more_than_twice_the_floor_of_6_hundredths_is_said_first(
    tmp_path: Path, left_deg: float, *, explained: bool
) -> None:
    found = lines(tmp_path, left_deg)
    text = "\n".join(found)
    doubt = "Attention         This record is not explained: the residual is 2.02 times the noise floor"
    assert found[0].startswith("Range of motion" if explained else doubt)
    assert text.count("not explained") == (not explained)
    assert "Missing           The model lacks an effect: sensor lag." in found
    assert f"Law               {made_up_law().sentence}" in found


@pytest.mark.parametrize(("r2", "code"), [(0.01, 0), (-0.01, 4)])
def test_a_run_whose_model_is_worse_than_a_constant_has_no_result(
    tmp_path: Path, r2: float, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    write_made_up_run(tmp_path, rate_hz=1.0)
    content = discovery() | {"after": AFTER | {"rmse_held_out_deg": 200.0, "r2_held_out": r2}}
    (tmp_path / "discovery.json").write_text(json.dumps(content), encoding="utf-8")
    (tmp_path / "track.json").unlink()
    assert answer_of(tmp_path).exit_code == code
    assert ("no better than a constant angle" in capsys.readouterr().err) == (code == 4)
