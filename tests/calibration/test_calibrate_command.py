"""``torsight calibrate`` and ``torsight board`` as a user meets them."""

import shutil
import tomllib

import cv2
import numpy as np
import pytest
import tomli_w
import typer
from made_up_views import CHESSBOARD, LENS, RIGHT_LENS, SIZE_PX, corners_px, in_right, picture, poses
from PIL import Image

from torsight.cli import board as board_module
from torsight.cli import calibrate as calibrate_module
from torsight.core.errors import ConfigError, InputError, NoResultError, TorsightError
from torsight.core.files.storage import write_table
from torsight.core.optics.camera import read_camera
from torsight.core.optics.geometry import project

app = typer.Typer(pretty_exceptions_enable=False)
app.command("calibrate", cls=calibrate_module.TakesRows)(calibrate_module.calibrate)
app.command("board")(board_module.board)


def run(*words):
    app(args=[str(word) for word in words], standalone_mode=False)


@pytest.fixture(scope="module")
def stereo(tmp_path_factory):
    path = tmp_path_factory.mktemp("stereo")
    for index, pose in enumerate(poses(9, 8)):
        cv2.imwrite(str(path / f"left{index}.png"), picture(pose, seed=index))
        cv2.imwrite(str(path / f"right{index}.png"), picture(in_right(pose), lens=RIGHT_LENS, seed=90 + index))
    return path


@pytest.fixture(scope="module")
def camera_toml(folder, board_toml, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "camera.toml"
    run("calibrate", folder, "--board", board_toml, "--out", out)
    return out


def test_camera_file_is_read_back_and_gives_an_account(camera_toml, folder):
    camera = read_camera(camera_toml)
    assert camera.intrinsics.size_px == SIZE_PX
    table = camera.extra
    sigma = table["left"]["sigma"]
    for key, true in (("fx_px", LENS.matrix[0, 0]), ("cx_px", LENS.matrix[0, 2])):
        row, column = {"fx_px": (0, 0), "cx_px": (0, 2)}[key]
        assert abs(camera.intrinsics.matrix[row, column] - true) < 4 * sigma[key]
    assert table["board"] == {"kind": "chessboard", "columns": 9, "rows": 6, "square_mm": 10.0}
    assert table["verdict"] in ("good", "usable")
    assert "made" not in table  # the same pictures give the same file on another day
    assert "numpy" in table["versions"]
    assert [row["name"] for row in table["left"]["pictures"]] == sorted(path.name for path in folder.iterdir())
    assert all(len(row["sha256"]) == 64 and row["error_px"] < 0.2 for row in table["left"]["pictures"])


def test_coverage_is_drawn_beside_the_camera_file(camera_toml):
    with Image.open(camera_toml.with_suffix(".coverage.png")) as image:
        pixels = np.asarray(image.convert("RGB"))
    assert pixels.shape[0] > 300
    # The shade of empty cells, and corners that are not grey.
    assert np.any(np.all(pixels == (0xF4, 0xD7, 0xD3), axis=-1))
    assert np.ptp(pixels.astype(int), axis=-1).max() > 100


def test_lists_after_options_are_taken_whole(stereo, board_toml, tmp_path, capsys):
    left, right = sorted(stereo.glob("left*")), sorted(stereo.glob("right*"))
    out = tmp_path / "pair.toml"
    run("calibrate", *left, "--right", *right, "--board", board_toml, "--out", out)
    content = tomllib.loads(out.read_text())
    assert set(content) == {"intrinsics", "right", "calibration"}
    camera = read_camera(out)
    pair = camera.extra["pair"]
    assert pair["baseline_mm"] == pytest.approx(np.linalg.norm([30.0, 0.6, 2.5]), abs=4 * pair["baseline_sigma_mm"])
    assert pair["epipolar_mean_px"] < 0.15
    said = capsys.readouterr().err
    assert "baseline" in said
    assert "Verdict" in said
    # Both cameras see a point of the board where the file says.
    point = np.array([[5.0, -8.0, 150.0]])
    seen = project(point, camera.right.intrinsics, rvec=camera.right.rvec, tvec_mm=camera.right.tvec_mm)
    true = in_right(np.array([0.0, 0.0, 0.0, *point[0]]))[3:]
    expected, _ = cv2.projectPoints(true[None], np.zeros(3), np.zeros(3), RIGHT_LENS.matrix, RIGHT_LENS.distortion)
    assert seen == pytest.approx(expected.reshape(1, 2), abs=0.5)


def test_pose_is_added_to_a_known_camera(camera_toml, board_toml, tmp_path):
    disk = np.array([0.2, -0.1, 0.4, 2.0, 1.0, 170.0])
    cv2.imwrite(str(tmp_path / "disk.png"), picture(disk, seed=5))
    out = tmp_path / "rig.toml"
    words = ["--camera", camera_toml, "--board", board_toml, "--pose", tmp_path / "disk.png"]
    run("calibrate", *words, "--base-z-mm", 1.5, "--moving-z-mm", 6, "--out", out)
    camera = read_camera(out)
    assert (camera.pose.base_z_mm, camera.pose.moving_z_mm) == (1.5, 6.0)
    axis = -cv2.Rodrigues(disk[:3])[0][:, 2]
    found = cv2.Rodrigues(camera.pose.rvec)[0][:, 2]
    assert np.degrees(np.arccos(found @ axis)) < 4 * max(camera.extra["axis"]["direction_sigma_deg"], 0.1)
    assert camera.pose.tvec_mm == pytest.approx(disk[3:], abs=1.0)
    assert camera.extra["left"] == read_camera(camera_toml).extra["left"]
    assert camera.extra["axis"]["pictures"][0]["name"] == "disk.png"


def test_known_camera_is_refused_for_another_picture_size(camera_toml, board_toml, tmp_path):
    grey = picture(np.array([0.2, -0.1, 0.4, 2.0, 1.0, 170.0]))
    cv2.imwrite(str(tmp_path / "large.png"), cv2.resize(grey, (800, 600)))
    cv2.imwrite(str(tmp_path / "turned.png"), np.rot90(grey))
    for name, said in (("large.png", "was scaled"), ("turned.png", "turned by a quarter")):
        with pytest.raises(ConfigError, match=said):
            run(
                "calibrate", "--camera", camera_toml, "--board", board_toml,
                "--pose", tmp_path / name, "--out", tmp_path / "x.toml",
            )  # fmt: skip
    assert not (tmp_path / "x.toml").exists()


def test_known_camera_is_refused_for_another_camera(camera_toml, board_toml, tmp_path):
    known = tomllib.loads(camera_toml.read_text())
    known["calibration"]["left"]["device"] = "Maker One 35 mm"
    (tmp_path / "known.toml").write_text(tomli_w.dumps(known))
    notes = Image.Exif()
    notes[271], notes[272] = "Maker", "Two"
    Image.fromarray(picture(np.array([0.2, -0.1, 0.4, 2.0, 1.0, 170.0]))).save(tmp_path / "disk.jpg", exif=notes)
    with pytest.raises(InputError, match=r"another camera or focal length.*Maker Two.*Maker One 35 mm"):
        run(
            "calibrate", "--camera", tmp_path / "known.toml", "--board", board_toml,
            "--pose", tmp_path / "disk.jpg", "--out", tmp_path / "x.toml",
        )  # fmt: skip


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "needs IMAGES"),
        (["a.png", "--camera", "c.toml"], "not both"),
        (["a.png", "--right", "b.png", "--pose", "c.png"], "no --pose for a stereo pair"),
    ],
)
def test_wrong_usage_is_told(words, said, board_toml, tmp_path):
    with pytest.raises(ConfigError, match=said) as caught:
        run("calibrate", *words, "--board", board_toml, "--out", tmp_path / "camera.toml")
    assert caught.value.exit_code == 2


def test_bad_input_leaves_no_file_and_says_what_is_needed(folder, board_toml, tmp_path):
    out = tmp_path / "camera.toml"
    same = tmp_path / "same"
    same.mkdir()
    for index in range(6):
        pose = np.array([0.3, 0.1, 0.02 * index, 2.0 * index - 5.0, 1.0, 150.0 + 5 * index])
        cv2.imwrite(str(same / f"{index}.png"), picture(pose, seed=index))
    two = tmp_path / "two"
    two.mkdir()
    for name in ("board00.png", "board01.png"):
        shutil.copy(folder / name, two / name)
    cases: list[tuple[object, type[TorsightError], int, str]] = [
        (same, NoResultError, 4, "all views are from the same side"),
        (two, NoResultError, 4, "too few views"),
        (tmp_path / "none", InputError, 3, "no such file"),
    ]
    for images, kind, code, said in cases:
        with pytest.raises(kind, match=said) as caught:
            run("calibrate", images, "--board", board_toml, "--out", out)
        assert caught.value.exit_code == code
    assert not out.exists()


def test_board_command_makes_what_calibrate_reads(tmp_path, capsys):
    run("board", "--out", tmp_path / "board.pdf", "--kind", "chessboard", "--dpi", 100)
    assert (tmp_path / "board.pdf").read_bytes().startswith(b"%PDF")
    grey = cv2.imread(str(tmp_path / "board.png"), cv2.IMREAD_GRAYSCALE)
    found, _ = cv2.findChessboardCorners(grey, (9, 6))
    assert found
    run("board", tmp_path / "board.toml", "--out", tmp_path / "again.svg", "--page", "a3", "--dpi", 60)
    assert "<svg" in (tmp_path / "again.svg").read_text()
    assert "print" in capsys.readouterr().err.lower()
    with pytest.raises(ConfigError, match="a4, a3"):
        run("board", "--out", tmp_path / "x.svg", "--page", "a9")


def test_commands_carry_an_example():
    for command in (calibrate_module.calibrate, board_module.board):
        assert "Example: torsight " in command.__doc__


def test_renderer_and_camera_agree():
    """The pictures of these tests put a corner where OpenCV projects it: their own check."""
    pose = np.array([0.1, 0.2, 0.0, 0.0, 0.0, 140.0])
    grey = picture(pose, noise=0.0)
    corners = corners_px(pose)
    refined = cv2.cornerSubPix(
        grey, corners.astype(np.float32).reshape(-1, 1, 2), (5, 5), (-1, -1), (3, 50, 1e-4)
    ).reshape(-1, 2)
    assert np.abs(refined - corners).max() < 0.1
    assert CHESSBOARD.corners == (9, 6)


def test_axis_from_the_circles_of_a_track(camera_toml, tmp_path, capsys):
    direction = np.array([0.2, 0.1, -1.0]) / np.linalg.norm([0.2, 0.1, -1.0])
    first = np.cross(direction, [0.0, 1.0, 0.3])
    first /= np.linalg.norm(first)
    turn = np.radians(np.linspace(0, 200, 150))
    wave = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * np.cross(direction, first)
    lens, rng = read_camera(camera_toml).intrinsics, np.random.default_rng(0)
    table = {"frame": np.arange(150), "time_s": np.arange(150) / 30.0}
    for name, radius in (("moving_inner", 10.0), ("moving_outer", 28.0)):
        pixels = project(np.array([3.0, -2.0, 150.0]) + radius * wave, lens) + rng.normal(0, 0.03, (150, 2))
        table |= {f"{name}_x_px": pixels[:, 0], f"{name}_y_px": pixels[:, 1]}
        table |= {f"{name}_sigma_px": np.full(150, 0.03), f"{name}_valid": np.arange(150) % 10 > 0}
    write_table(tmp_path / "markers.csv", table)
    words = ["--camera", camera_toml, "--tracks", tmp_path / "markers.csv", "--out", tmp_path / "rig.toml"]
    run("calibrate", *words, "--stick-mm", 18.0, "--base-z-mm", -6.0)
    made = read_camera(tmp_path / "rig.toml")
    sigma_rad = np.radians(made.extra["axis"]["direction_sigma_deg"])
    assert np.arccos(cv2.Rodrigues(made.pose.rvec)[0][:, 2] @ direction) < 4 * sigma_rad < 0.01
    assert made.pose.tvec_mm == pytest.approx([3.0, -2.0, 150.0], rel=0.01)
    assert made.pose.base_z_mm == -6.0
    assert made.extra["left"] == read_camera(camera_toml).extra["left"]
    assert "of the markers' circles" in capsys.readouterr().err
    with pytest.raises(ConfigError, match="needs a known --camera"):
        run("calibrate", "--tracks", tmp_path / "markers.csv", "--out", tmp_path / "x.toml")
    write_table(tmp_path / "other.csv", {"frame": np.arange(3)})
    with pytest.raises(InputError, match="no column 'moving_inner_x_px'"):
        run("calibrate", "--camera", camera_toml, "--tracks", tmp_path / "other.csv", "--out", tmp_path / "x.toml")
