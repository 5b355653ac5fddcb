"""Camera files: what stands in them comes back; what is wrong is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tomli_w

from torsight.core.errors import ConfigError
from torsight.core.optics.camera import Camera, Intrinsics, Pose, RightCamera, camera_content, read_camera, require_size


def _camera() -> Camera:
    lens = Intrinsics(
        size_px=(640, 480),
        matrix=np.array([[1200.0, 0, 319.5], [0, 1190.0, 239.5], [0, 0, 1]]),
        distortion=np.array([-0.15, 0.01, 1e-3, -2e-3, 0.1]),
    )
    return Camera(
        intrinsics=lens,
        pose=Pose(np.array([3.1, 0.1, 0.0]), np.array([1.0, 2.0, 300.0]), 0.0, 6.0),
        right=RightCamera(lens, np.array([0, 0.1, 0]), np.array([-60.0, 0, 2.0])),
        extra={"board": "charuco"},
    )


def test_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    content = camera_content(_camera())
    path.write_text(tomli_w.dumps(content))
    assert camera_content(read_camera(path)) == content


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"intrinsic": {}}, "unknown key 'intrinsic'.*did you mean 'intrinsics'"),
        ({"intrinsics": {"width": 640}}, "no key 'fx_px'"),
        ({"pose": {"rvec": [1, 2], "tvec_mm": [0, 0, 1]}}, "'rvec' is not a list of 3 numbers"),
        ({"pose": 3}, "'pose' is not a table"),
        ({"pose": {"rvec": [0, 0, 0], "tvec_mm": [0, 0, 300]}}, r"camera.toml, \[pose\].*in front.*found .* -300.0 mm"),
        (
            {"planes": {"moving_z_mm": 400}},
            "in front.*allowed beyond .* at 400 mm.*correct the planes",
        ),
        ({"planes": {"base_z": 1}}, "did you mean 'base_z_mm'"),
        ({"right": {"intrinsics": 1, "from_left": {}}}, "is not a table"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, change: dict[str, object], words: str) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(tomli_w.dumps({**camera_content(_camera()), **change}))
    with pytest.raises(ConfigError, match=words):
        read_camera(path)


def test_a_focal_length_of_nothing_is_refused(tmp_path: Path) -> None:
    content = camera_content(_camera())
    content["intrinsics"]["fx_px"] = -3.0
    path = tmp_path / "camera.toml"
    path.write_text(tomli_w.dumps(content))
    with pytest.raises(ConfigError, match="'fx_px' is out of range; found -3; allowed 1e-09 or more"):
        read_camera(path)


def test_a_picture_of_another_size_names_the_camera_file(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(tomli_w.dumps(camera_content(_camera())))
    with pytest.raises(ConfigError, match=r"camera.toml, \[right.intrinsics\].*a quarter"):
        require_size(read_camera(path), (480, 640), film="the film", right=_camera().right)
