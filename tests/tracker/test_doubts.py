"""Angles that come out and are wrong all the same: what is said of them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from films import Rig, write_film

from torsight.cli.track import track_to_folder

RIG = Rig(lambda t: 60.0 + 40.0 * (np.cos(5.0 * t) - 1.0), frames=30)
SLOW = replace(RIG, angle_deg=lambda t: 60.0 + 12.0 * (np.cos(1.5 * t) - 1.0))


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_film(RIG, tmp_path_factory.mktemp("film") / "film.mkv")


def advice_of(film: Path, out: Path, **options: object) -> list[str]:
    track_to_folder(film, out=out, **options)
    return json.loads((out / "track.json").read_text())["advice"]


def positions() -> tuple[list[list[float]], list[list[float]]]:
    place = RIG.marker_px(float(RIG.truth_deg[0])).tolist()
    return place[:2], place[2:]


def test_a_track_that_is_right_raises_no_doubt(film: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    base, moving = positions()
    assert not [text for text in advice_of(film, tmp_path, markers={"base": base, "moving": moving}) if "exch" in text]
    assert "warning" not in capsys.readouterr().err


@pytest.mark.parametrize("stick", ["base", "moving"])
def test_inner_and_outer_exchanged_on_one_stick(
    film: Path, tmp_path: Path, stick: str, capsys: pytest.CaptureFixture[str]
) -> None:
    base, moving = positions()
    markers = {"base": base, "moving": moving}
    markers[stick] = markers[stick][::-1]
    first = advice_of(film, tmp_path, markers=markers)[0]
    assert f"markers of the {stick} stick are exchanged" in first
    assert "off by 180 degrees" in first
    assert first in capsys.readouterr().err
    inner_px, outer_px = RIG.base_px if stick == "base" else RIG.moving_px
    told = re.search(r"inner marker is (\d+) px from the axis, its outer one (\d+) px", first)
    assert told is not None
    # Whole pixels, and the moving stick is 1 % nearer to the camera.
    assert [int(number) for number in told.groups()] == pytest.approx([outer_px, inner_px], abs=1.0 + 0.01 * outer_px)


@pytest.mark.parametrize(("rig", "words"), [(SLOW, "The sticks seem to be exchanged"), (RIG, "The base is not where")])
def test_base_and_moving_exchanged(rig: Rig, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # Slow enough to be followed for a while as if the base shook, or lost at once.
    base, moving = positions()
    film = write_film(rig, tmp_path / "film.mkv")
    first = advice_of(film, tmp_path / "out", markers={"base": moving, "moving": base})[0]
    assert first.startswith(words)
    assert "Exchange base and moving" in first
    assert first in capsys.readouterr().err
