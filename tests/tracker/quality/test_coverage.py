"""Films in which few frames have an angle: a warning below nine tenths, exit code 4 below a half."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from tests.tracker.films import Rig, write_film
from torsight.cli.main import main
from torsight.cli.track import few_angles
from tracker.quality.account import advice

RIG = Rig(lambda t: 60.0 - 60.0 * t, frames=40)
"""Forty frames at 30 a second; the lamp is off in a share of them."""


@pytest.mark.parametrize(
    ("dark_s", "code", "told"),
    [
        (None, 0, ""),
        ((0.6, 0.9), 0, "warning: "),
        ((0.4, 1.2), 4, "less than half of the frames have an angle"),
    ],
)
def test_few_frames_with_an_angle(
    dark_s: tuple[float, float] | None, code: int, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    film, out = tmp_path / "film.mkv", tmp_path / "out"
    write_film(replace(RIG, dark_s=dark_s), film)
    with pytest.raises(SystemExit) as ended:
        main(["track", str(film), "--out", str(out), "--json"])
    answer, errors = capsys.readouterr()
    assert ended.value.code == code
    content = json.loads(answer)
    assert content["exit_code"] == code
    assert {path.name for path in out.iterdir()} == {"angle.csv", "markers.csv", "track.json", "track.png"}
    share = pd.read_csv(out / "angle.csv")["valid"].mean()
    assert (share < 0.5) == (code == 4)
    assert ("most of the others" in errors) == (share < 0.9)
    assert told in errors
    if told:
        assert str(film) in errors
    if code:
        assert "most of the others: the light is off" in errors


def test_why_frames_have_no_angle_comes_before_what_makes_the_others_better() -> None:
    told = {
        "compression": {"error_over_white_noise": 4.5, "codec": "h264", "lossless": False},
        "noise": {
            "marker_contrast_grey": 100.0,
            "marker_sigma_px": {"bound": 0.03, "reached": 0.1},
            "angle_sigma_deg": {"median": 0.2},
        },
        "frames": {"total": 100, "with_angle": 70},
    }
    gap = "30 of 100 frames have no angle (30 lost): start filming later."
    words = advice(told, length_px=100.0, radius_px=6.0, events=[], gaps=[gap])
    assert words[0] == gap
    assert "bit rate" in words[1]
    assert "displaces them by 0.03 px" in words[2]
    assert "100 px apart" in words[3]
    few = few_angles({**told, "advice": words}, where="film.mp4")
    assert few is not None
    assert few.do == "start filming later"


def test_a_bare_command_shows_its_help(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([])
    assert ended.value.code == 0
    shown = capsys.readouterr().out
    assert "Usage: torsight" in shown
    assert "discover" in shown
