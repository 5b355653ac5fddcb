"""Films on disk: every frame, its stamp and its angle; the files beside them; the same bytes again."""

from __future__ import annotations

import tomllib
from pathlib import Path

import av
import cv2
import numpy as np
import pandas as pd
import pytest

from torsight.core.errors import OutputError
from torsight.core.files.tables import require_increasing
from torsight.core.optics.camera import read_camera
from torsight.core.units import DEG
from torsight.synthetic.scene import scene_from
from torsight.synthetic.scene_files import render_scene


def frames(path: Path) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return stamps, s, and luma planes as they were decoded."""
    stamps, pictures = [], []
    with av.open(str(path)) as container:
        for frame in container.decode(video=0):
            stamps.append(float(frame.pts * frame.time_base))
            plane = frame.planes[0]
            luma = np.frombuffer(plane, np.uint8).reshape(plane.height, plane.line_size)[:, : plane.width]
            pictures.append(luma.copy())
    return np.array(stamps), pictures


def direction_deg(picture: np.ndarray, scene, view) -> float:
    """Return the moving stick's direction less the base stick's, by matching pictures without noise (brute force)."""
    from torsight.synthetic.filming.studio import Studio

    studio = Studio(scene, view, purpose="0")
    tried = np.arange(-180.0, 180.0, 1.0)
    still = {"shift_px": np.zeros(2), "gain": 1.0, "bars": [], "lit": False}
    costs = [np.mean((studio.frame(np.array([angle * DEG]), **still).astype(float) - picture) ** 2) for angle in tried]
    return float(tried[int(np.argmin(costs))])


def test_film_log_and_files_belong_together(tmp_path: Path, small_scene: dict) -> None:
    scene = scene_from(small_scene)
    experiment = render_scene(scene, out=tmp_path)
    truth = pd.read_csv(tmp_path / "truth.csv")
    stamps, pictures = frames(tmp_path / "film.mkv")
    assert truth["frame"].tolist() == list(range(20))
    assert stamps == pytest.approx(truth["time_s"].to_numpy(), abs=1e-9)
    expected = 60.0 + 40.0 * (np.cos(2 * np.pi * truth["time_s"] / 4.0) - 1.0)
    assert truth["angle_deg"].to_numpy() == pytest.approx(expected.to_numpy(), abs=1e-5)
    log = pd.read_csv(tmp_path / "temps.csv")
    require_increasing(log["time_s"].to_numpy(), path=tmp_path / "temps.csv")
    assert {"time_s", "temp_a_c", "temp_b_c"} <= set(log.columns)
    content = tomllib.loads(experiment.read_text())
    for table, key in (("video", "path"), ("camera", "file"), ("temperature", "path"), ("actuator", "file")):
        assert (tmp_path / content[table][key]).exists()
    assert read_camera(tmp_path / "camera.toml").intrinsics.size_px == (320, 240)
    assert not list(tmp_path.glob(".*"))
    # A second renderer: markers where plain projection says, dark on light.
    markers = tomllib.loads((tmp_path / "markers.toml").read_text())
    for x, y in markers["base"] + markers["moving"]:
        assert pictures[0][round(y), round(x)] < 60


def test_picture_shows_the_angle_of_the_truth(tmp_path: Path, small_scene: dict) -> None:
    from torsight.synthetic.filming.optics import views

    scene = scene_from(small_scene)
    render_scene(scene, out=tmp_path)
    truth = pd.read_csv(tmp_path / "truth.csv")
    _, pictures = frames(tmp_path / "film.mkv")
    for index in (0, 19):
        assert direction_deg(pictures[index], scene, views(scene)[0]) == pytest.approx(
            truth["angle_deg"][index], abs=0.75
        )


@pytest.mark.parametrize("codec", ["h264", "ffv1", "mjpeg", "png"])
def test_same_seed_same_bytes(tmp_path: Path, small_scene: dict, codec: str) -> None:
    small_scene["film"]["codec"] = codec
    small_scene["motion"]["duration_s"] = 0.3
    for name in ("first", "again"):
        render_scene(scene_from(small_scene), out=tmp_path / name)
    files = sorted(path.relative_to(tmp_path / "first") for path in (tmp_path / "first").rglob("*") if path.is_file())
    assert len(files) >= 8
    for file in files:
        assert (tmp_path / "first" / file).read_bytes() == (tmp_path / "again" / file).read_bytes(), file
    other = scene_from({**small_scene, "seed": 99})
    render_scene(other, out=tmp_path / "other")
    assert (tmp_path / "other" / "temps.csv").read_bytes() != (tmp_path / "first" / "temps.csv").read_bytes()


def test_h264_keeps_the_grey_levels(tmp_path: Path, small_scene: dict) -> None:
    pictures = {}
    for codec, name in (("ffv1", "film.mkv"), ("h264", "film.mp4")):
        small_scene["film"] = {"fps": 20.0, "codec": codec, "crf": 4}
        render_scene(scene_from(small_scene), out=tmp_path / codec)
        _, pictures[codec] = frames(tmp_path / codec / name)
    for exact, coded in zip(pictures["ffv1"], pictures["h264"], strict=True):
        difference = coded.astype(float) - exact
        assert abs(difference.mean()) < 0.2
        assert difference.std() < 1.5


def test_dropped_frames_and_jitter_are_in_the_stamps(tmp_path: Path, small_scene: dict) -> None:
    small_scene["film"] = {"fps": 25.0, "codec": "h264", "dropped": 0.3, "jitter": 0.3}
    small_scene["motion"]["duration_s"] = 4.0
    render_scene(scene_from(small_scene), out=tmp_path)
    truth = pd.read_csv(tmp_path / "truth.csv")
    stamps, _ = frames(tmp_path / "film.mp4")
    assert 0.5 < len(stamps) / 100 < 0.9
    assert stamps == pytest.approx(truth["time_s"].to_numpy(), abs=1e-9)
    assert np.std(np.diff(stamps)) > 0.2 / 25.0


def test_pair_sees_the_same_moments_from_two_places(tmp_path: Path, small_scene: dict) -> None:
    small_scene["stereo"] = {"baseline_mm": 60.0, "toe_in_deg": 11.0}
    small_scene["camera"]["distance_mm"] = 300.0
    experiment = render_scene(scene_from(small_scene), out=tmp_path)
    assert tomllib.loads(experiment.read_text())["video"]["path"] == ["film_left.mkv", "film_right.mkv"]
    (left, first), (right, second) = (frames(tmp_path / f"film_{side}.mkv") for side in ("left", "right"))
    assert np.array_equal(left, right)
    assert np.mean(np.abs(first[0].astype(float) - second[0])) > 2.0
    assert read_camera(tmp_path / "camera.toml").right is not None


def test_folder_of_pictures_holds_every_frame(tmp_path: Path, small_scene: dict) -> None:
    small_scene["film"]["codec"] = "png"
    experiment = render_scene(scene_from(small_scene), out=tmp_path)
    found = sorted((tmp_path / "film").glob("*.png"))
    assert len(found) == 20
    assert cv2.imread(str(found[0]), cv2.IMREAD_UNCHANGED).shape == (240, 320)
    assert tomllib.loads(experiment.read_text())["video"] == {"path": "film", "fps": 20.0}


def test_what_happens_to_the_film_shows_in_it(tmp_path: Path, small_scene: dict) -> None:
    small_scene["event"] = [
        {"kind": "dark", "start_s": 0.2, "duration_s": 0.2},
        {"kind": "bump", "start_s": 0.5, "shift_px": [4.0, 0.0]},
        {"kind": "hand", "start_s": 0.6, "duration_s": 0.3, "over": "moving_outer"},
        {"kind": "wire", "start_s": 0.9, "duration_s": 0.1, "over": "base", "level": 0.0},
    ]
    small_scene["light"] = {"flicker": 0.2}
    small_scene["motion"] = {"kind": "still", "duration_s": 1.0}
    render_scene(scene_from(small_scene), out=tmp_path)
    _, pictures = frames(tmp_path / "film.mkv")
    levels = np.array([picture.mean() for picture in pictures])
    assert levels[4:8].max() < 8.0
    assert np.ptp(levels[:4]) / levels[0] > 0.1
    markers = tomllib.loads((tmp_path / "markers.toml").read_text())
    x, y = (round(value) for value in markers["moving"][1])
    assert pictures[0][y, x] < 60 < pictures[15][y, x + 4]
    x, y = (round(value) for value in np.mean(markers["base"], axis=0))
    assert pictures[19][y, x] < 60 < pictures[11][y, x + 4]


def test_shake_moves_the_whole_picture_and_not_the_truth(tmp_path: Path, small_scene: dict) -> None:
    small_scene["camera"]["shake_px"] = 1.5
    small_scene["motion"] = {"kind": "still", "duration_s": 1.0}
    render_scene(scene_from(small_scene), out=tmp_path)
    _, pictures = frames(tmp_path / "film.mkv")
    shifts = [cv2.phaseCorrelate(pictures[0].astype(float), picture.astype(float))[0] for picture in pictures]
    assert 0.3 < np.std(shifts) < 4.0
    assert np.ptp(pd.read_csv(tmp_path / "truth.csv")["angle_deg"]) == 0.0


def test_slipped_marker_and_eccentricity_are_what_the_camera_sees(tmp_path: Path, small_scene: dict) -> None:
    small_scene["effects"] = {"marker_slip": {"time_s": 0.5, "step_deg": 5.0}}
    small_scene["motion"] = {"kind": "still", "duration_s": 1.0}
    render_scene(scene_from(small_scene), out=tmp_path)
    truth = pd.read_csv(tmp_path / "truth.csv")
    assert truth["angle_deg"].tolist() == [60.0] * 10 + [65.0] * 10
    assert np.ptp(truth["actuator_deg"]) == 0.0


def test_failure_leaves_the_older_film(tmp_path: Path, small_scene: dict, monkeypatch: pytest.MonkeyPatch) -> None:
    small_scene["film"]["codec"] = "h264"
    render_scene(scene_from(small_scene), out=tmp_path)
    before = (tmp_path / "film.mp4").read_bytes()

    def broken(*_args: object, **_keys: object) -> None:
        msg = "disk full"
        raise OSError(msg)

    monkeypatch.setattr("torsight.synthetic.filming.film_writer.Encoder.encode", broken)
    with pytest.raises(OutputError, match="disk full"):
        render_scene(scene_from({**small_scene, "seed": 8}), out=tmp_path)
    assert (tmp_path / "film.mp4").read_bytes() == before
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]
