"""Films and pictures as they come: order, times, damage, and what cannot be read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.tracker.films import Rig, write_film, write_pictures
from torsight.core.errors import ConfigError, InputError
from tracker.frames.sample import Clip, read_timestamps
from tracker.frames.source import open_source

RIG = Rig(lambda t: 40.0 * t, frames=12, size=(160, 120), base_px=(15, 40), moving_px=(13, 38), noise=1.0)


def test_a_lossless_film_gives_every_pixel_and_time(tmp_path: Path) -> None:
    rig = replace(RIG, jitter=0.6, drop=(3, 7))
    source = open_source(write_film(rig, tmp_path / "film.mkv"))
    assert repr(source) == f"FilmSource({tmp_path / 'film.mkv'}, 160 × 120 px, uncounted frames)"
    frames = [(frame.index, frame.time_s, frame.luma.copy()) for frame in source]
    assert [index for index, _, _ in frames] == list(range(10))
    np.testing.assert_allclose([time_s for _, time_s, _ in frames], rig.times - rig.times[0], atol=1e-3)
    for (_, _, luma), picture in zip(frames, rig.pictures(), strict=True):
        np.testing.assert_array_equal(luma, picture)
    assert source.size_px == (160, 120)
    assert source.damage.entries == []


@pytest.mark.parametrize("width", [320, 330, 512])
def test_a_film_of_any_width_gives_rows_without_gaps(tmp_path: Path, width: int) -> None:
    rig = replace(RIG, size=(width, 240))
    drawn = rig.pictures()
    for frame in open_source(write_film(rig, tmp_path / "film.mkv", codec="ffv1", crf=None)):
        assert frame.luma is not None
        assert frame.luma.flags.c_contiguous
        np.testing.assert_array_equal(frame.luma, next(drawn))


def test_pictures_come_in_the_order_of_their_names(tmp_path: Path) -> None:
    folder = write_pictures(RIG, tmp_path / "pictures")
    (folder / "notes.txt").write_text("not a picture")
    for source in (open_source(folder, fps=10.0), open_source(str(folder / "*.png"), fps=10.0)):
        assert repr(source).endswith(", 160 × 120 px, 12 pictures)")
        frames = list(source)
        assert len(frames) == RIG.frames
        np.testing.assert_allclose([frame.time_s for frame in frames], np.arange(12) / 10.0)
        np.testing.assert_array_equal(frames[0].luma, next(RIG.pictures()))


def test_numbers_in_names_count_by_their_size(tmp_path: Path) -> None:
    folder = tmp_path / "run_2"
    folder.mkdir()
    for number in range(12):
        cv2.imwrite(str(folder / f"img_{number}.png"), np.full((8, 8), 10 * number, np.uint8))
    for source in (open_source(folder, fps=10.0), open_source(str(folder / "img_*.png"), fps=10.0)):
        levels = [int(frame.luma[0, 0]) for frame in source if frame.luma is not None]
        assert levels == [10 * number for number in range(12)]


def test_a_picture_that_cannot_be_read_is_a_frame_without_one(tmp_path: Path) -> None:
    folder = write_pictures(RIG, tmp_path / "pictures")
    (folder / "picture_00004.png").write_bytes(b"broken")
    source = open_source(folder)
    frames = list(source)
    assert len(frames) == RIG.frames
    assert [frame.index for frame in frames if frame.luma is None] == [4]
    assert source.damage.entries[0]["frame"] == 4


def write_deep(folder: Path, *, bits: int, gain: tuple[float, ...]) -> list[np.ndarray]:
    """Write one picture per gain, of a camera with this depth in the low bits of 16; return them as bytes."""
    folder.mkdir()
    bright = next(RIG.pictures()).astype(np.float64) / 255.0
    deep = [np.floor(np.minimum(one * bright, 1.0) * (2**bits - 1)).astype(np.uint16) for one in gain]
    for number, picture in enumerate(deep):
        cv2.imwrite(str(folder / f"picture_{number:05d}.png"), picture)
    return [(picture // 2 ** (bits - 8)).astype(np.uint8) for picture in deep]


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_deep_pictures_are_scaled_by_the_depth_in_use_whatever_the_first_one_is_like(tmp_path: Path, bits: int) -> None:
    # The first picture is dark and would fit into a smaller depth by itself.
    expected = write_deep(tmp_path / "deep", bits=bits, gain=(0.02, 1.3, 1.3, 0.4))
    source = open_source(tmp_path / "deep")
    for frame, picture in zip(source, expected, strict=True):
        np.testing.assert_array_equal(frame.luma, picture)
    assert source.describe()["bits_in_use"] == bits
    assert source.damage.entries == []


def test_a_part_of_deep_pictures_is_scaled_as_the_whole(tmp_path: Path) -> None:
    expected = write_deep(tmp_path / "deep", bits=12, gain=(0.05, 0.05, 1.3))
    source = open_source(tmp_path / "deep")
    frames = list(Clip(source, read_timestamps(source), first=0, count=2))
    assert len(frames) == 2
    for frame, picture in zip(frames, expected[:2], strict=True):
        np.testing.assert_array_equal(frame.luma, picture)


def test_a_deep_picture_brighter_than_those_looked_at_is_clipped_and_told_once(tmp_path: Path) -> None:
    expected = write_deep(tmp_path / "deep", bits=10, gain=(1.0,) * 60)
    brightest = np.minimum(expected[1].astype(np.uint16) * 16, 65535)
    for number in (1, 4):
        cv2.imwrite(str(tmp_path / "deep" / f"picture_{number:05d}.png"), brightest)
    source = open_source(tmp_path / "deep")
    frames = [frame.luma for frame in source]
    np.testing.assert_array_equal(frames[1], np.minimum(brightest // 4, 255))
    np.testing.assert_array_equal(frames[2], expected[2])
    assert [(entry["frame"], entry["kind"]) for entry in source.damage.entries] == [(1, "clipped")]
    assert "1023" in source.damage.entries[0]["text"]


def test_pictures_of_two_sizes_are_refused(tmp_path: Path) -> None:
    folder = write_pictures(RIG, tmp_path / "pictures")
    cv2.imwrite(str(folder / "picture_00005.png"), np.zeros((50, 60), np.uint8))
    with pytest.raises(InputError, match=r"frame 5.*another size.*60 × 50"):
        list(open_source(folder))


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("film.mp4", {"g": "10"}),
        ("film.mkv", {"g": "400", "bf": "3"}),
        ("film.ts", {"g": "400"}),
        ("film.h264", {"g": "10"}),
        ("film.avi", {"g": "1", "bf": "0"}),
    ],
)
def test_single_frames_are_those_of_the_pass(tmp_path: Path, name: str, options: dict[str, str]) -> None:
    rig = replace(RIG, frames=330)
    source = open_source(write_film(rig, tmp_path / name, codec="libx264", crf=20, options=options))
    passed = {frame.index: frame.luma.copy() for frame in source}
    assert len(passed) == rig.frames
    told = list(source.damage.entries)
    # The last ones lie further from the only key frame than is decoded to reach one that is sought.
    wanted = [329, 0, 81, 83, 319, 164]
    found = source.pictures(wanted)
    assert sorted(found) == sorted(wanted)
    for index, luma in found.items():
        np.testing.assert_array_equal(luma, passed[index])
    assert source.damage.entries == told


def test_a_single_frame_that_cannot_be_had_is_left_out(tmp_path: Path) -> None:
    folder = write_pictures(RIG, tmp_path / "pictures")
    (folder / "picture_00004.png").write_bytes(b"broken")
    assert sorted(open_source(folder).pictures([3, 4])) == [3]
    film = open_source(write_film(RIG, tmp_path / "film.mkv"))
    # Before any pass no timestamps are known: the frames are taken from one.
    assert sorted(film.pictures([2, RIG.frames])) == [2]


def test_times_from_a_table(tmp_path: Path) -> None:
    film = write_film(RIG, tmp_path / "film.mkv")
    table = tmp_path / "times.csv"
    table.write_text("frame,time_s\n" + "".join(f"{i},{100 + i * 0.5}\n" for i in range(12)))
    assert [frame.time_s for frame in open_source(film, timestamps=table)] == [100 + i * 0.5 for i in range(12)]
    table.write_text("frame,time_s\n0,1\n1,2\n")
    with pytest.raises(InputError, match="frame 2"):
        list(open_source(film, timestamps=table))


def test_a_film_that_was_cut_keeps_what_came_before(tmp_path: Path) -> None:
    rig = replace(RIG, frames=40, noise=4.0)
    film = write_film(rig, tmp_path / "film.mkv")
    content = film.read_bytes()
    film.write_bytes(content[: int(0.6 * len(content))])
    source = open_source(film)
    frames = [frame for frame in source if frame.luma is not None and not frame.damaged]
    assert 15 < len(frames) < 40
    for frame, picture in zip([frame.index for frame in frames], rig.pictures(), strict=False):
        assert frame < 40
        assert picture.shape == (120, 160)


def test_a_film_without_a_count_of_frames_that_was_cut_is_told_by_its_length(tmp_path: Path) -> None:
    film = write_film(RIG, tmp_path / "film.mkv", codec="ffv1", crf=None)
    whole = open_source(film)
    assert len(list(whole)) == RIG.frames
    assert not whole.damage.entries
    content = film.read_bytes()
    film.write_bytes(content[: len(content) // 2])
    cut = open_source(film)
    count = len(list(cut))
    assert 0 < count < RIG.frames
    (entry,) = cut.damage.entries
    assert f"ends after frame {count - 1}" in entry["text"]
    assert "it was cut" in entry["text"]


def test_damage_within_a_film_is_named_and_nothing_hangs_on_it(tmp_path: Path) -> None:
    rig = replace(RIG, frames=60, noise=4.0)
    film = write_film(rig, tmp_path / "film.mp4", codec="libx264", crf=12, options={"g": "20", "bf": "0"})
    clean = [frame.luma.copy() for frame in open_source(film)]
    content = bytearray(film.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 1500] = b"\xff" * 1500
    film.write_bytes(bytes(content))
    source = open_source(film)
    frames = [(frame.damaged, None if frame.luma is None else frame.luma.copy()) for frame in source]
    assert len(frames) == 60
    assert source.damage.entries
    assert any(damaged for damaged, _ in frames)
    assert not all(damaged for damaged, _ in frames)
    # Whatever is not marked is as it was.
    for (damaged, luma), before in zip(frames, clean, strict=True):
        if not damaged:
            np.testing.assert_array_equal(luma, before)
    first = next(index for index, (damaged, _) in enumerate(frames) if damaged)
    assert source.damage.entries[0]["frame"] == first


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("empty.mp4", b"", "empty file"),
        ("noise.mp4", bytes(range(256)) * 40, "not a film"),
        ("text.mkv", b"time_s,angle\n1,2\n", "not a film"),
    ],
)
def test_what_is_no_film_is_said_to_be_none(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=words):
        open_source(path)


def test_what_is_not_there(tmp_path: Path) -> None:
    (tmp_path / "film.mp4").write_bytes(b"x")
    with pytest.raises(InputError, match=r"did you mean film\.mp4"):
        open_source(tmp_path / "flim.mp4")
    (tmp_path / "none").mkdir()
    with pytest.raises(InputError, match="has no pictures"):
        open_source(tmp_path / "none")
    with pytest.raises(ConfigError, match="--fps"):
        open_source(tmp_path / "film.mp4", fps=-3.0)
