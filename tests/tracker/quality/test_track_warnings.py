"""Angles that come out and are wrong all the same, and files that are not whole: what is said of them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.tracker.films import Cover, Rig, write_film, write_pictures
from torsight.cli.track import is_no_result, track_to_folder
from torsight.core.errors import NoResultError
from torsight.core.tracks import MarkerTracks, StickAngles
from tracker import track
from tracker.quality.gaps import find_causes, gap_advice, smear_around_gaps_px
from tracker.rows import ROW
from tracker.track import TrackResult

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


def test_markers_that_hardly_stand_out_are_told(
    film: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not [text for text in advice_of(film, tmp_path / "clear") if "stand out" in text]
    seen = track.find_start
    monkeypatch.setattr(track, "find_start", lambda *given, **named: replace(seen(*given, **named), doubtful=True))
    first = advice_of(film, tmp_path / "faint")[0]
    assert "hardly stand out" in first
    assert first in capsys.readouterr().err


def test_a_tilt_that_the_motion_does_not_show_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = replace(RIG, angle_deg=lambda t: 60.0 + 4.0 * np.sin(5.0 * t))
    film = write_film(rig, tmp_path / "film.mkv")
    (tmp_path / "camera.toml").write_text(rig.camera_toml())
    first = advice_of(film, tmp_path / "without")[0]
    assert "tilt is not known" in first
    assert first in capsys.readouterr().err
    # It covers 8 degrees, and says so.
    told = re.search(r"covers (\d+) degrees .* wrong by some ([\d.]+) degrees, and the noise is ([\d.]+)\.", first)
    assert told is not None
    assert float(told[1]) == pytest.approx(8.0, abs=1.0)
    sigma_deg = json.loads((tmp_path / "without" / "track.json").read_text())["noise"]["angle_sigma_deg"]["median"]
    assert np.hypot(float(told[2]), float(told[3])) == pytest.approx(sigma_deg, rel=0.1)
    assert float(told[2]) > 0.2 > float(told[3])
    assert not [text for text in advice_of(film, tmp_path / "with", camera=tmp_path / "camera.toml") if "tilt" in text]
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


@pytest.mark.parametrize("rig", [SLOW, RIG])
def test_base_and_moving_exchanged(rig: Rig, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    base, moving = positions()
    film = write_film(rig, tmp_path / "film.mkv")
    first = advice_of(film, tmp_path / "out", markers={"base": moving, "moving": base})[0]
    assert first.startswith("The sticks seem to be exchanged")
    assert "Exchange base and moving" in first
    assert first in capsys.readouterr().err
    assert is_no_result(json.loads((tmp_path / "out" / "track.json").read_text()))


def test_a_base_that_is_hardly_ever_seen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    base, moving = positions()
    hidden = replace(RIG, covers=[Cover(0.2, 1.0, "base", size_px=60.0)])
    resting = replace(hidden, angle_deg=lambda t: 60.0 + 0.0 * t)
    first = advice_of(
        write_film(resting, tmp_path / "film.mkv"), tmp_path / "out", markers={"base": base, "moving": moving}
    )[0]
    assert first.startswith("The base is not where")
    assert "Exchange base and moving" in first
    assert first in capsys.readouterr().err
    # A stick that turned against the base is the moving one.
    film = write_film(hidden, tmp_path / "film.mkv")
    told = advice_of(film, tmp_path / "out", markers={"base": base, "moving": moving})
    assert not any("Exchange" in text for text in told)


def test_a_dot_beside_the_stick_is_no_marker_of_the_stick(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    base, moving = positions()
    rig = replace(RIG, frames=60, extra_dots=[(90.0, -60.0, 5.0)])
    film = write_film(rig, tmp_path / "film.mkv")
    beside = (rig.project(np.array([90.0, -60.0, 0.0]))).tolist()
    first = advice_of(film, tmp_path / "out", markers={"base": base, "moving": [moving[0], beside]})[0]
    assert first.startswith("The two markers of the moving stick do not move as one body")
    assert first in capsys.readouterr().err
    told = re.search(r"varies by some ([\d.]+) px, and their dots have a radius of ([\d.]+) px", first)
    assert told is not None
    assert float(told[1]) > 0.5 * float(told[2])
    assert float(told[2]) == pytest.approx(5.0, abs=0.5)


def test_a_screw_beside_the_base_is_no_marker_of_the_base(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    base, moving = positions()
    rig = replace(RIG, frames=60, extra_dots=[(90.0, -60.0, 5.0)])
    film = write_film(rig, tmp_path / "film.mkv")
    beside = (rig.project(np.array([90.0, -60.0, 0.0]))).tolist()
    first = advice_of(film, tmp_path / "out", markers={"base": [base[0], beside], "moving": moving})[0]
    assert first.startswith("The two dots given for the base stick may not be on one stick")
    assert first in capsys.readouterr().err
    away, along = base[0] - rig.project(np.zeros(3)), np.subtract(beside, base[0])
    passed_px = abs(away[0] * along[1] - away[1] * along[0]) / np.hypot(*along)
    told = re.search(r"passes the axis at (\d+) px", first)
    assert told is not None
    assert float(told[1]) == pytest.approx(passed_px, abs=1.5)


@pytest.mark.parametrize(("order", "do"), [([0, 3, 2, 1], "exchange the outer positions"), ([0, 2, 1, 3], "reverse")])
def test_dots_of_different_sticks_are_no_stick(order: list[int], do: str, film: Path, tmp_path: Path) -> None:
    places = np.concatenate(positions())[order].tolist()
    with pytest.raises(NoResultError, match=r"are on different sticks.*two dots of one stick") as told:
        track_to_folder(film, markers={"base": places[:2], "moving": places[2:]}, out=tmp_path)
    assert do in str(told.value)


def test_a_smear_is_told_as_a_shutter_too_long() -> None:
    result, angles = made_gap(share=0.5)
    frames = {"total": 40, "without_angle": 10, "why": {"hidden": 10}}
    # 10 degrees per frame at 76 px from the axis, half of it with the shutter open.
    expected_px = 0.5 * 2.0 * 76.0 * np.sin(np.deg2rad(5.0))
    assert smear_around_gaps_px(result, angles) == pytest.approx(expected_px, rel=1e-6)
    (words,) = gap_advice(frames, find_causes(result, angles, ["hidden"] * 10))
    assert "shutter" in words
    assert "hands" not in words
    result, angles = made_gap(share=0.0)
    assert "keep hands" in gap_advice(frames, find_causes(result, angles, ["hidden"] * 10))[0]


@pytest.mark.parametrize(
    ("state", "words"),
    [
        ("lost", "torsight markers"),
        ("outside", "from further away"),
        ("shadowed", "further apart"),
        ("dark", "steady lamp"),
        ("damaged", "copy it from the camera"),
    ],
)
def test_each_cause_has_its_own_advice(state: str, words: str) -> None:
    result, angles = made_gap(share=0.0)
    causes = find_causes(result, angles, [state] * 9 + ["hidden"])
    (told,) = gap_advice({"total": 40, "without_angle": 10, "why": {state: 9, "hidden": 1}}, causes)
    assert words in told
    assert "hands" not in told


def made_gap(*, share: float) -> tuple[TrackResult, StickAngles]:
    """Return positions of a stick that turns by 10 degrees per frame and is not seen in ten of them."""
    n = 40
    turn = np.deg2rad(10.0 * np.arange(n))
    seen = (np.arange(n) < 15) | (np.arange(n) >= 25)
    position = np.zeros((n, 4, 2))
    position[:, 3] = 76.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    position[~seen] = np.nan
    valid = np.repeat(seen[:, None], 4, axis=1)
    frame, time_s = np.arange(n), np.arange(n) / 30.0
    tracks = MarkerTracks(frame, time_s, position, np.tile(np.eye(2), (n, 4, 1, 1)), valid, (320, 240))
    report = {"markers": {"shutter_share_of_frame": share, "radius_px": 5.0, "stick_length_px": 100.0}}
    sigma = np.where(seen, 0.01, np.nan)
    angles = StickAngles(frame, time_s, np.where(seen, turn, np.nan), sigma, seen, np.ones(n, bool))
    return TrackResult(tracks, np.zeros(n, ROW), [], report), angles


def test_a_table_of_times_that_is_too_long(film: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "times.csv"
    table.write_text("frame,time_s\n" + "".join(f"{i},{i / 30.0:.6f}\n" for i in range(32)))
    pictures = write_pictures(RIG, tmp_path / "pictures")
    for number, source in enumerate((film, pictures)):
        first = advice_of(source, tmp_path / str(number), timestamps=table)[0]
        assert "32 rows for 30 frames" in first
        assert first in capsys.readouterr().err


def test_a_damaged_film_is_not_put_down_to_hands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = replace(RIG, frames=60, noise=4.0)
    film = write_film(rig, tmp_path / "film.mp4", codec="libx264", crf=12, options={"g": "20", "bf": "0"})
    content = bytearray(film.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 1500] = b"\xff" * 1500
    film.write_bytes(bytes(content))
    advice = advice_of(film, tmp_path / "out")
    assert advice[0].startswith("The file is damaged: frame ")
    assert advice[0] in capsys.readouterr().err
    about = next(text for text in advice if "have no angle" in text)
    assert "file is damaged there" in about
    assert "hands" not in about


def test_hands_are_told_as_hands(tmp_path: Path) -> None:
    film = write_film(replace(RIG, covers=[Cover(0.4, 0.7, "moving")]), tmp_path / "film.mkv")
    assert "keep hands" in next(text for text in advice_of(film, tmp_path / "out") if "have no angle" in text)
