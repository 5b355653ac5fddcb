"""The command: files, exit codes and messages of the contract, and going on after an interruption."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.tracker.films import Rig, write_film
from tests.tracker.flat_films import FlatFilm, Sprite, tag
from torsight.core.errors import ConfigError, InputError, NoResultError, TorsightError
from torsight.core.files.storage import read_json
from tracker.frames.source import open_source

ROOT = Path(__file__).parents[2]
RIG = Rig(lambda t: 60.0 - 60.0 * t, frames=24)
OUTPUTS = ("angle.csv", "markers.csv", "track.json", "track.png")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("film")
    write_film(RIG, place / "film.mkv")
    (place / "camera.toml").write_text(RIG.camera_toml())
    (place / "markers.toml").write_text(RIG.markers_toml())
    return place


def test_the_files_of_the_contract(folder: Path, tmp_path: Path) -> None:
    from torsight.cli.track import track_to_folder

    angles = track_to_folder(
        folder / "film.mkv", camera=folder / "camera.toml", markers=folder / "markers.toml", out=tmp_path
    )
    assert sorted(item.name for item in tmp_path.iterdir()) == sorted(OUTPUTS)
    table = pd.read_csv(tmp_path / "angle.csv")
    assert list(table.columns[:5]) == ["frame", "time_s", "angle_deg", "angle_sigma_deg", "valid"]
    assert table["frame"].tolist() == list(range(24))
    np.testing.assert_allclose(table["angle_deg"], np.rad2deg(angles.angle_rad), rtol=1e-8)
    np.testing.assert_allclose(table["angle_deg"], RIG.truth_deg, atol=0.1)
    markers = pd.read_csv(tmp_path / "markers.csv")
    for name in ("base_inner", "base_outer", "moving_inner", "moving_outer"):
        assert {f"{name}_{end}" for end in ("x_px", "y_px", "sigma_px", "valid", "x_mm", "y_mm", "z_mm")} <= set(
            markers.columns
        )
    content = json.loads((tmp_path / "track.json").read_text())
    assert content["schema"] == 1
    assert {"noise", "frames", "compression", "advice", "events"} <= set(content)
    assert content["frames"]["with_angle"] == 24


def failing(folder: Path, tmp_path: Path, **options: object) -> TorsightError:
    from torsight.cli.track import track_to_folder

    with pytest.raises(TorsightError) as caught:
        track_to_folder(options.pop("video", folder / "film.mkv"), out=tmp_path / "out", **options)
    # Where no markers are found the tables have every frame, none with an angle, whatever was there before.
    left = {name for name in OUTPUTS if (tmp_path / "out" / name).exists()}
    assert left == (set(OUTPUTS) if isinstance(caught.value, NoResultError) else set())
    if left:
        content = json.loads((tmp_path / "out" / "track.json").read_text())
        assert content["frames"]["total"] == len(pd.read_csv(tmp_path / "out" / "markers.csv")) > 0
        assert not pd.read_csv(tmp_path / "out" / "angle.csv")["valid"].any()
    return caught.value


def pair_of_tags(place: Path) -> tuple[FlatFilm, dict[str, Path]]:
    """Film two sticks with tags, and a third tag that is none of theirs, from two sides; return what was filmed."""
    sticks = [[Sprite(**tag("5X5_100", number, side_mm=40.0, along_mm=70.0))] for number in (3, 4)]
    sticks[0].append(Sprite(**tag("5X5_100", 9, side_mm=30.0, along_mm=-60.0)))
    films = [FlatFilm(*sticks, lambda t: 60.0 + 90.0 * t, frames=36, tilt_deg=tilt) for tilt in (0.0, 20.0)]
    given: dict[str, Path] = {
        "video": films[0].write(place / "left.mkv"),
        "right": films[1].write(place / "right.mkv"),
        "camera": place / "pair.toml",
    }
    (width, height), away_mm, turn = films[0].size, films[0].distance_mm, np.deg2rad(20.0)
    lens = f"width = {width}\nheight = {height}\nfx_px = {away_mm}\nfy_px = {away_mm}\n"
    lens += f"cx_px = {0.5 * (width - 1)}\ncy_px = {0.5 * (height - 1)}\n"
    # The plane is turned about the picture's x axis, at one distance of its middle.
    place_mm = away_mm * np.array([0.0, -np.sin(turn), 1.0 - np.cos(turn)])
    given["camera"].write_text(
        f"[intrinsics]\n{lens}[right.intrinsics]\n{lens}"
        f"[right.from_left]\nrvec = [{-turn}, 0.0, 0.0]\ntvec_mm = {place_mm.tolist()}\n"
    )
    return films[0], given


def test_tags_that_are_named_are_followed_in_both_films(tmp_path: Path) -> None:
    from torsight.cli.track import track_to_folder

    made, given = pair_of_tags(tmp_path)
    markers = {"kind": "tag", "family": "5X5_100", "base_id": 3, "moving_id": 4}
    angles = track_to_folder(given.pop("video"), **given, markers=markers, out=tmp_path / "out")
    assert angles.valid.all()
    np.testing.assert_allclose(np.rad2deg(angles.angle_rad), made.truth_deg, atol=0.3)


def test_positions_of_texture_in_one_film_of_two(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "markers.toml"
    path.write_text("kind = 'texture'\nbase = [[60, 60], [99, 99]]\nmoving = [[30, 30], [60, 90]]\n")
    pair = tmp_path / "pair.toml"
    lens = RIG.camera_toml().split("[pose]")[0]
    pair.write_text(
        lens
        + lens.replace("[intrinsics]", "[right.intrinsics]")
        + "[right.from_left]\nrvec = [0.0, 0.1, 0.0]\ntvec_mm = [-60.0, 0.0, 3.0]\n"
    )
    error = failing(folder, tmp_path, right=folder / "film.mkv", camera=pair, markers=path)
    assert isinstance(error, ConfigError)
    assert "the left film" in str(error)
    assert "texture" in str(error)


def test_markers_outside_the_picture(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "markers.toml"
    path.write_text("base = [[10, 10], [700, 20]]\nmoving = [[30, 30], [60, 60]]\n")
    error = failing(folder, tmp_path, markers=path)
    assert isinstance(error, ConfigError)
    assert "base, outer" in str(error)
    assert "319" in str(error)


def test_markers_where_there_is_no_dot(folder: Path, tmp_path: Path) -> None:
    error = failing(folder, tmp_path, markers={"base": [[10, 10], [20, 200]], "moving": [[300, 30], [280, 200]]})
    assert isinstance(error, NoResultError)
    assert "no round dot" in str(error)


def test_an_unknown_key_names_the_nearest(folder: Path, tmp_path: Path) -> None:
    error = failing(folder, tmp_path, markers={"base": [[1, 1], [2, 20]], "movng": [[3, 3], [4, 40]]})
    assert isinstance(error, ConfigError)
    assert "did you mean 'moving'" in str(error)


def test_a_camera_for_another_picture_size(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(replace(RIG, size=(640, 480)).camera_toml())
    error = failing(folder, tmp_path, camera=path)
    assert isinstance(error, ConfigError)
    assert "640 × 480" in str(error)
    assert "320 × 240" in str(error)


def test_a_pair_s_camera_file_with_one_film_is_said(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from torsight.cli.track import track_to_folder

    (tmp_path / "pair.toml").write_text(RIG.pair_toml(replace(RIG, tilt_deg=(0.0, 12.0))))
    track_to_folder(folder / "film.mkv", camera=tmp_path / "pair.toml", out=tmp_path / "out")
    assert "one film was given" in capsys.readouterr().err
    content = json.loads((tmp_path / "out" / "track.json").read_text())
    assert next(event["text"] for event in content["events"] if event["kind"] == "camera").startswith("The camera file")
    assert "lens" in content["method"]


def test_distances_measured_by_hand_have_to_be_lengths(folder: Path, tmp_path: Path) -> None:
    p = RIG.marker_px(float(RIG.truth_deg[0])).tolist()
    error = failing(folder, tmp_path, markers={"base": p[:2], "moving": p[2:], "base_mm": -3.0})
    assert isinstance(error, ConfigError)
    assert "base_mm" in str(error)


def test_a_film_without_markers(tmp_path: Path) -> None:
    bare = replace(RIG, base_px=(5000.0, 5100.0), moving_px=(5000.0, 5100.0), hub_px=0.0, frames=3)
    write_film(replace(bare, overhang_px=-4000.0), tmp_path / "bare.mkv")
    error = failing(tmp_path, tmp_path, video=tmp_path / "bare.mkv")
    assert isinstance(error, NoResultError)
    assert "frames 0 to 2" in str(error)


def test_an_empty_file(tmp_path: Path) -> None:
    (tmp_path / "empty.mp4").write_bytes(b"")
    error = failing(tmp_path, tmp_path, video=tmp_path / "empty.mp4")
    assert isinstance(error, InputError)


def test_a_film_in_which_nothing_moves(tmp_path: Path) -> None:
    write_film(replace(RIG, angle_deg=lambda t: 60.0 + 0.0 * t, frames=6), tmp_path / "still.mkv")
    error = failing(tmp_path, tmp_path, video=tmp_path / "still.mkv")
    assert isinstance(error, NoResultError)
    assert "no stick moves" in str(error)
    # Which dots were followed, so that a person sees whether they are the markers.
    assert "dots of 5 to 5 px radius and 1" in str(error)


def test_faint_dots_that_hardly_move_give_no_angle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tracker import track

    # A motion of 2 degrees is one of clear dots, but not of dots that may as well be background.
    write_film(replace(RIG, angle_deg=lambda t: 60.0 + 2.0 * np.sin(9.0 * t), frames=12), tmp_path / "film.mkv")
    found = track.track_film(open_source(tmp_path / "film.mkv"))
    assert found.tracks.valid.all()
    seen = track.find_start
    monkeypatch.setattr(track, "find_start", lambda *given, **named: replace(seen(*given, **named), doubtful=True))
    with pytest.raises(NoResultError, match=r"no stick moves.*were followed, last at \["):
        track.track_film(open_source(tmp_path / "film.mkv"))


def start(film: Path, markers: Path, out: Path) -> subprocess.Popen[bytes]:
    """Track in a process of its own that writes a checkpoint after every frame and is slow enough to be stopped."""
    code = (
        "import sys, time\n"
        "import tracker.checkpoint as c, tracker.follow.follower as f\n"
        "c.RowStore.due = property(lambda self: True)\n"
        "step = f.Follower.step\n"
        "def slow(self, frame):\n"
        "    time.sleep(0.03)\n"
        "    return step(self, frame)\n"
        "f.Follower.step = slow\n"
        "from pathlib import Path\n"
        "from torsight.cli.track import track_to_folder\n"
        "a, m, o = map(Path, sys.argv[1:])\n"
        "track_to_folder(a, markers=m, out=o, resume=True)\n"
    )
    return subprocess.Popen(
        [sys.executable, "-c", code, str(film), str(markers), str(out)],
        cwd=ROOT,
        stderr=subprocess.DEVNULL,
        # A shell may have told its background jobs to ignore Ctrl-C, which children would inherit.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # noqa: PLW1509 - no threads here
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )


def test_a_track_that_was_stopped_ends_in_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    from torsight.cli.track import track_to_folder

    film, markers = folder / "film.mkv", folder / "markers.toml"
    track_to_folder(film, markers=markers, out=tmp_path / "whole")
    out = tmp_path / "stopped"
    state = out / ".track" / "state.json"
    done = 0
    for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT):
        process = start(film, markers, out)
        for _ in range(3000):
            rows = _rows_of(state)
            if rows > done + 2 or process.poll() is not None:
                break
            time.sleep(0.02)
        assert process.poll() is None, "it ended before it could be stopped"
        process.send_signal(number)
        assert process.wait(timeout=30) != 0
        assert not (out / "angle.csv").exists()
        # What was done is kept, and the next run goes on from there instead of starting anew.
        assert _rows_of(state) > done
        done = _rows_of(state)
    track_to_folder(film, markers=markers, out=out, resume=True)
    for name in OUTPUTS:
        assert (out / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    assert not (out / ".track").exists()


def test_a_checkpoint_of_another_film_is_not_gone_on_from(folder: Path, tmp_path: Path) -> None:
    from torsight.cli.track import track_to_folder
    from tracker.checkpoint import RowStore
    from tracker.rows import ROW

    store = RowStore(tmp_path / "out" / ".track", key="another film")
    store.begin()
    store.add(np.zeros((), ROW))
    store.checkpoint({})
    # Like every JSON file it has its schema.
    assert read_json(tmp_path / "out" / ".track" / "state.json")["rows"] == 1
    film, markers = folder / "film.mkv", folder / "markers.toml"
    track_to_folder(film, markers=markers, out=tmp_path / "out", resume=True)
    track_to_folder(film, markers=markers, out=tmp_path / "whole")
    for name in OUTPUTS:
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    shutil.rmtree(tmp_path / "out")


def _rows_of(state: Path) -> int:
    try:
        return int(json.loads(state.read_text())["rows"])
    except (OSError, ValueError):
        return 0
