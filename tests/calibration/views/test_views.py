"""From files to views: what is looked at, chosen, refused."""

from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from made_up_views import (
    CHARUCO,
    CHESSBOARD,
    LENS,
    RIGHT_LENS,
    RIGHT_TVEC_MM,
    corners_px,
    in_right,
    picture,
    poses,
    whole,
)
from PIL import Image

from calibration.boards.board_file import Board
from calibration.stage import calibrate_one, calibrate_two
from calibration.views.board_views import find_views
from calibration.views.picture_files import expand
from torsight.core.errors import InputError, NoResultError


def write_film(path: Path, pictures, *, codec="ffv1"):
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = pictures[0].shape[1], pictures[0].shape[0], "gray"
        for grey in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(grey, format="gray")))
        container.mux(stream.encode())


def test_folder_glob_and_files_are_the_same(folder, tmp_path):
    files = sorted(folder.iterdir())
    assert expand([folder]) == expand(files) == expand([folder / "board*.png"]) == files
    with pytest.raises(InputError, match="holds no picture"):
        expand([tmp_path])
    with pytest.raises(InputError, match="holds no picture"):
        expand([folder / "nothing*.png"])
    with pytest.raises(InputError, match=r"did you mean board03\.png"):
        expand([folder / "bord03.png"])


def test_every_picture_is_accounted_for(folder, tmp_path):
    empty = tmp_path / "empty.png"
    cv2.imwrite(str(empty), np.full((300, 400), 120, np.uint8))
    again = tmp_path / "again.png"
    again.write_bytes((folder / "board02.png").read_bytes())
    seen = find_views([folder, empty, again], CHESSBOARD)
    assert [view.name for view in seen.views] == [f"board{index:02d}.png" for index in range(11)]
    notes = {source.name: source.note for source in seen.sources if source.note}
    assert notes == {"empty.png": "the board was not found", "again.png": "the same picture as board02.png"}
    assert len({source.sha256 for source in seen.sources}) == 12
    assert seen.size_px == (400, 300)


def test_pictures_of_different_sizes_are_refused(folder, tmp_path):
    other = tmp_path / "other.png"
    cv2.imwrite(str(other), np.full((301, 400), 120, np.uint8))
    with pytest.raises(InputError, match=r"other\.png.*400 × 301.*400 × 300 as board00\.png"):
        find_views([folder, other], CHESSBOARD)


def test_pictures_of_different_cameras_are_refused(folder, tmp_path):
    paths = []
    for name, model, focal in (("a.jpg", "One", 35), ("b.jpg", "One", 50)):
        notes = Image.Exif()
        notes[271], notes[272] = "Maker", model
        notes.get_ifd(34665)[37386] = focal
        paths.append(tmp_path / name)
        with Image.open(folder / "board00.png") as image:
            image.save(paths[-1], exif=notes)
    with pytest.raises(InputError, match=r"b\.jpg.*Maker One 50 mm.*Maker One 35 mm as a\.jpg"):
        find_views(paths, CHESSBOARD)


def test_file_that_is_no_picture_is_refused(tmp_path):
    for name, said in (("broken.png", "not a readable picture"), ("notes.md", "neither a picture nor a film")):
        (tmp_path / name).write_text("nothing to see")
        with pytest.raises(InputError, match=said):
            find_views([tmp_path / name], CHESSBOARD)


def test_no_board_says_so_and_a_wrong_board_says_which(folder, tmp_path):
    blank = tmp_path / "blank.png"
    cv2.imwrite(str(blank), np.full((300, 400), 120, np.uint8))
    with pytest.raises(NoResultError, match=r"no picture shows the board.*9 × 6 inner corners"):
        find_views([blank], CHESSBOARD)
    with pytest.raises(NoResultError, match=r"does not fit.*board00\.png shows a chessboard of 9 × 6 inner corners"):
        find_views([folder / "board00.png"], Board("chessboard", 10, 7, 10.0))
    with pytest.raises(NoResultError, match="does not fit"):
        find_views([folder / "board00.png"], CHARUCO)


def test_film_gives_sharp_and_different_frames(tmp_path):
    where = whole(poses(80, 4, distance_mm=(150.0, 220.0)))[:8]
    frames, truth, blurred = [], {}, set()
    for place, pose in enumerate(where):
        still = picture(pose, seed=place)
        for repeat in range(4):
            index = len(frames)
            truth[index] = pose
            if repeat == 3:
                blurred.add(index)
                frames.append(cv2.GaussianBlur(still, (0, 0), 1.5))
            else:
                frames.append(still)
    write_film(tmp_path / "board.mkv", frames)
    seen = find_views([tmp_path / "board.mkv"], CHESSBOARD)
    numbers = [view.index for view in seen.views]
    assert not blurred & set(numbers)
    # Stills of one pose are alike: one of each is taken.
    assert [number // 4 for number in numbers] == list(range(8))
    for view in seen.views:
        error = view.corners_px - corners_px(truth[view.index])
        assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 0.12
    assert seen.views[0].name == f"board.mkv frame {numbers[0]}"


def test_long_film_is_looked_at_in_steps(tmp_path):
    frames = [np.full((30, 40), 120, np.uint8)] * 481
    write_film(tmp_path / "long.mkv", frames)
    with pytest.raises(NoResultError, match="no picture shows the board"):
        find_views([tmp_path / "long.mkv"], CHESSBOARD)


def test_sides_that_are_no_pairs_are_refused(folder):
    files = sorted(folder.iterdir())
    with pytest.raises(InputError, match="11 left, 10 right"):
        calibrate_two(files, files[1:], CHESSBOARD)
    with pytest.raises(InputError, match="given as left and as right"):
        calibrate_two(files, files, CHESSBOARD)


def test_verdict_says_why(folder):
    files = sorted(folder.iterdir())
    few = calibrate_one(files[:5], CHESSBOARD).verdict
    assert few.word == "do again"
    assert any(reason.startswith("views: 5, good is at least 10") for reason in few.reasons)
    all_of_them = calibrate_one(files, CHESSBOARD).verdict
    assert not any(reason.startswith("views") for reason in all_of_them.reasons)


def test_two_films_that_start_together_are_a_pair(tmp_path):
    where = whole(poses(80, 8, distance_mm=(170.0, 230.0)))[:7]
    # One exposure lies blurred between any two: it must be chosen on neither side.
    for side, lens, place in (("left", LENS, lambda pose: pose), ("right", RIGHT_LENS, in_right)):
        frames = []
        for index, pose in enumerate(where):
            still = picture(place(pose), lens=lens, seed=index)
            frames += [cv2.GaussianBlur(still, (0, 0), 1.5), still]
        write_film(tmp_path / f"{side}.mkv", frames)
    stereo = calibrate_two([tmp_path / "left.mkv"], [tmp_path / "right.mkv"], CHESSBOARD)
    assert all(index % 2 == 1 for index in stereo.pair.index)
    assert len(stereo.pair.index) >= 6
    assert stereo.pair.right.tvec_mm == pytest.approx(RIGHT_TVEC_MM, abs=4 * stereo.pair.sigma[3:].max())
    assert stereo.pair.epipolar_px.mean() < 0.15
