"""Films as phones and cameras write them: codecs, depth, turned, mirrored, interlaced, slow motion, two streams."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest

from tests.tracker.films import Rig, write_film
from torsight.core.errors import InputError
from torsight.core.tracks import StickAngles
from tracker.angle.orient import orient
from tracker.frames.sample import Clip, read_timestamps
from tracker.frames.source import open_source
from tracker.frames.timing import timing
from tracker.quality.account import account
from tracker.quality.track_warnings import doubts
from tracker.track import TrackResult, track_film

RIG = Rig(lambda t: 60.0 - 60.0 * t, frames=24)
CRISP = {"crf": "8", "preset": "ultrafast"}
COMPRESSED = 8.0
"""Light compression makes positions up to this factor worse than the pixels' noise: 5 to 8 at CRF 18."""


def write(
    path: Path,
    pictures: Iterable[np.ndarray],
    codec: str,
    *,
    pix_fmt: str = "yuv420p",
    fps: int = 30,
    options: dict[str, str] | None = None,
    prepare: Callable[[Any], None] = lambda _: None,
    pts: Callable[[int], int] = lambda index: index,
    metadata: dict[str, str] | None = None,
    hidden: int = 0,
) -> Path:
    """Encode pictures of the luma's own depth (8 bits, or the format's in 16), with neutral colour.

    The first ``hidden`` frames are stored, because others hang on them, but lie before the film begins.
    """
    try:
        av.Codec(codec, "w")
    except ValueError:
        pytest.skip(f"this FFmpeg cannot encode {codec}")
    keys = {"options": {"movflags": "use_metadata_tags"}} if metadata else {}
    with av.open(str(path), "w", **keys) as container:
        container.metadata.update(metadata or {})
        stream: Any = None
        packets: list[Any] = []
        for index, picture in enumerate(pictures):
            height, width = picture.shape
            if stream is None:
                stream = container.add_stream(codec, rate=fps)
                stream.width, stream.height, stream.pix_fmt = width, height, pix_fmt
                stream.options = options or {}
                stream.codec_context.time_base = Fraction(1, fps)
                prepare(stream)
            frame = _frame(picture, pix_fmt)
            frame.pts, frame.time_base = pts(index), Fraction(1, fps)
            packets += stream.encode(frame)
        for packet in (*packets, *stream.encode(None)):
            packet.pts, packet.dts = packet.pts - hidden, packet.dts - hidden
            container.mux(packet)
    return path


def _frame(picture: np.ndarray, pix_fmt: str) -> av.VideoFrame:
    """Return a frame with the picture as its luma, unscaled."""
    height, width = picture.shape
    frame = av.VideoFrame(width, height, pix_fmt)
    deep = pix_fmt.endswith("10le")
    for number, plane in enumerate(frame.planes):
        rows = np.full(
            (plane.height, plane.line_size // (2 if deep else 1)), 512 if deep else 128, "<u2" if deep else "u1"
        )
        if number == 0:
            rows[:, :width] = picture
        plane.update(rows.tobytes())
    return frame


def track(path: Path, **options: Any) -> tuple[TrackResult, StickAngles, dict[str, Any]]:
    source = open_source(path, **options)
    result = track_film(source)
    orientation = orient(result.tracks, None, pixel_aspect=source.pixel_aspect)
    return result, orientation.angles, account(result, orientation, doubts=doubts(result))


def tolerance_deg(rig: Rig, *, levels: float | None = None, factor: float = COMPRESSED) -> float:
    """Four standard deviations by the Cramér–Rao bound of a sharp disc, times what compression makes of it."""
    levels = rig.stick - rig.dot if levels is None else levels
    sigma_px = max(rig.noise, 0.3) / levels / np.sqrt(np.pi * rig.radius_px)
    lengths = rig.base_px[1] - rig.base_px[0], rig.moving_px[1] - rig.moving_px[0]
    return 4.0 * factor * float(np.rad2deg(sigma_px * np.sqrt(2.0) * np.hypot(1.0 / lengths[0], 1.0 / lengths[1])))


def check(angles: StickAngles, truth_deg: np.ndarray, *, within_deg: float) -> None:
    assert angles.valid.all()
    np.testing.assert_allclose(np.rad2deg(angles.angle_rad), truth_deg, atol=within_deg)


def to_linear(picture: np.ndarray) -> np.ndarray:
    return (picture / 255.0) ** 2.4


def to_pq(picture: np.ndarray) -> np.ndarray:
    """SMPTE ST 2084 with white at 203 cd/m² (ITU-R BT.2408), narrow range of 10 bits."""
    share = (203.0 / 10000.0 * to_linear(picture)) ** 0.1593017578125
    code = ((0.8359375 + 18.8515625 * share) / (1.0 + 18.6875 * share)) ** 78.84375
    return np.rint(64.0 + 876.0 * code).astype(np.uint16)


def to_hlg(picture: np.ndarray) -> np.ndarray:
    """ARIB STD-B67 with white at 0.265 of the scene's peak (BT.2408: 75 % of the signal), narrow range of 10 bits."""
    light = 0.265 * to_linear(picture)
    low = np.sqrt(3.0 * light)
    high = 0.17883277 * np.log(np.maximum(12.0 * light - 0.28466892, 1e-9)) + 0.55991073
    return np.rint(64.0 + 876.0 * np.where(light <= 1.0 / 12.0, low, high)).astype(np.uint16)


def to_ten_bits(picture: np.ndarray) -> np.ndarray:
    return picture.astype(np.uint16) << 2


def x265(more: str = "") -> dict[str, str]:
    return {**CRISP, "x265-params": f"log-level=error:pools=none:frame-threads=1:{more}".rstrip(":")}


@pytest.mark.parametrize(
    ("name", "codec", "pix_fmt", "options", "coded", "transfer"),
    [
        ("hevc.mp4", "libx265", "yuv420p10le", x265(), to_ten_bits, None),
        ("pq.mp4", "libx265", "yuv420p10le", x265("transfer=smpte2084:colorprim=bt2020"), to_pq, "pq"),
        ("hlg.mov", "libx265", "yuv420p10le", x265("transfer=arib-std-b67:colorprim=bt2020"), to_hlg, "hlg"),
        (
            "film.webm",
            "libvpx-vp9",
            "yuv420p",
            {"crf": "8", "b": "0", "cpu-used": "8", "deadline": "realtime"},
            None,
            None,
        ),
        ("av1.mp4", "libsvtav1", "yuv420p", {"crf": "8", "preset": "12"}, None, None),
        ("av1.mkv", "libsvtav1", "yuv420p10le", {"crf": "8", "preset": "12"}, to_ten_bits, None),
        ("film.mov", "prores_ks", "yuv422p10le", {}, to_ten_bits, None),
    ],
)
def test_codecs_depths_and_transfer_functions(
    name: str, codec: str, pix_fmt: str, options: dict[str, str], coded: Any, transfer: str | None, tmp_path: Path
) -> None:
    rig = replace(RIG, frames=12)
    pictures = (picture if coded is None else coded(picture) for picture in rig.pictures())
    path = write(tmp_path / name, pictures, codec, pix_fmt=pix_fmt, options=options)
    _, angles, told = track(path)
    levels = told["noise"]["marker_contrast_grey"]
    assert told["source"]["pixel_format"] == pix_fmt
    assert told["source"].get("transfer") == transfer
    assert levels == pytest.approx(_levels(coded), rel=0.1)
    # No faint dots.
    assert levels > 40.0
    check(angles, rig.truth_deg, within_deg=tolerance_deg(rig, levels=levels))


def _levels(coded: Callable[[np.ndarray], np.ndarray] | None) -> float:
    """Return the step of brightness at the moving dots, in levels of 8 bits."""
    ends = np.array([0.97 * RIG.stick, RIG.dot])
    values = ends if coded is None else coded(ends) / 4.0 if coded is not to_ten_bits else ends
    return float(values[0] - values[1])


@pytest.mark.parametrize("turn", list(product((False, True), (1, -1), (1, -1))))
def test_a_display_matrix_is_obeyed(turn: tuple[bool, int, int], tmp_path: Path) -> None:
    """Every stored pixel is where the matrix (ISO/IEC 14496-12) sends it."""
    transposed, sign_x, sign_y = turn
    first = next(RIG.pictures())[:120, :160]
    height, width = first.shape
    # Columns before rows: x' = a x + c y + t, y' = b x + d y + u; the shifts keep the picture's corner at the origin.
    a, b, c, d = (0, sign_y, sign_x, 0) if transposed else (sign_x, 0, 0, sign_y)
    t = (height if transposed else width) if sign_x < 0 else 0
    u = (width if transposed else height) if sign_y < 0 else 0
    matrix = [a << 16, b << 16, 0, c << 16, d << 16, 0, t << 16, u << 16, 1 << 30]
    path = write(
        tmp_path / "film.mp4",
        [first] * 3,
        "libx264",
        options={"qp": "0"},
        prepare=lambda stream: stream.set_display_matrix(matrix),
    )
    source = open_source(path)
    assert source.size_px == ((height, width) if transposed else (width, height))
    shown = next(iter(source)).luma
    assert shown is not None
    y, x = np.mgrid[:height, :width] + 0.5
    column, row = a * x + c * y + t, b * x + d * y + u
    np.testing.assert_array_equal(shown[np.floor(row).astype(int), np.floor(column).astype(int)], first)
    timestamps = read_timestamps(source)
    np.testing.assert_array_equal(next(iter(Clip(source, timestamps, first=1, count=1))).luma, shown)
    assert source.describe().get("mirrored", False) == (a * d - b * c < 0)


@pytest.mark.parametrize("quarters", [0, 1])
def test_pixels_that_are_not_square(quarters: int, tmp_path: Path) -> None:
    """A picture squeezed to three quarters of its width, with pixels a third wider than high; also stored turned."""
    squeezed = (cv2.resize(picture, (240, 240), interpolation=cv2.INTER_AREA) for picture in RIG.pictures())
    stored = (np.rot90(picture, -quarters) for picture in squeezed)

    def prepare(stream: Any) -> None:
        stream.codec_context.sample_aspect_ratio = Fraction(3, 4) if quarters else Fraction(4, 3)
        if quarters:
            stream.set_display_rotation(90 * quarters)

    path = write(tmp_path / "film.mp4", stored, "libx264", options=CRISP, prepare=prepare)
    assert open_source(path).pixel_aspect == pytest.approx(4.0 / 3.0)
    check(track(path)[1], RIG.truth_deg, within_deg=tolerance_deg(RIG))


FIELDS = Rig(lambda t: 60.0 - 200.0 * t, frames=48, fps=60.0)
"""Two fields for every frame of a film of 30; 3.3 degrees, 4.4 px of the outer marker, between them."""


def woven(*, top_first: bool) -> Iterable[np.ndarray]:
    fields = list(FIELDS.pictures())
    for one, two in zip(fields[::2], fields[1::2], strict=True):
        whole = np.empty_like(one)
        first, second = (0, 1) if top_first else (1, 0)
        whole[first::2], whole[second::2] = one[first::2], two[second::2]
        yield whole


@pytest.mark.parametrize("order", ["tff", "bff"])
def test_of_an_interlaced_film_the_first_field_is_read(order: str, tmp_path: Path) -> None:
    options = {**CRISP, "x264-params": f"{order}=1"}
    path = write(tmp_path / "film.mp4", woven(top_first=order == "tff"), "libx264", options=options)
    _, angles, told = track(path)
    # Every second row is made up: half of the light on a dot is measured, and its rim is softer.
    check(angles, FIELDS.truth_deg[::2], within_deg=2.0 * tolerance_deg(FIELDS))
    assert told["advice"][0].startswith("The film is interlaced: ")
    assert "progressive" in told["advice"][0]
    assert [event["kind"] for event in told["events"]].count("interlaced") == 1


def test_slow_motion_is_timed_by_the_rate_of_capture(tmp_path: Path) -> None:
    path = write(tmp_path / "film.mp4", RIG.pictures(), "libx264", options=CRISP)
    as_captured = track(path, fps=240.0)[2]
    assert as_captured["source"]["capture_fps"] == 240.0
    assert as_captured["timing"]["rate_fps"] == pytest.approx(240.0)
    np.testing.assert_allclose([frame.time_s for frame in open_source(path, fps=240.0)], np.arange(24) / 240.0)
    source = open_source(path, fps=240.0)
    np.testing.assert_allclose(read_timestamps(source).time_s, np.arange(24) / 240.0)


def test_a_camera_that_notes_its_rate_of_capture_is_heard(tmp_path: Path) -> None:
    noted = {"com.android.capture.fps": "240.000000"}
    path = write(tmp_path / "film.mp4", RIG.pictures(), "libx264", options=CRISP, metadata=noted)
    advice = track(path)[2]["advice"]
    assert "--fps 240" in advice[0]
    assert "wrong by 8" in advice[0]
    assert not [text for text in track(path, fps=240.0)[2]["advice"] if "--fps" in text]


def test_a_variable_frame_rate_keeps_its_timestamps(tmp_path: Path) -> None:
    ticks = np.cumsum([0, *np.random.default_rng(4).integers(700, 4000, RIG.frames - 1)])
    path = write(
        tmp_path / "film.mp4", RIG.pictures(), "libx264", options=CRISP, fps=90000, pts=lambda index: int(ticks[index])
    )
    _, angles, told = track(path)
    np.testing.assert_allclose(angles.time_s, ticks / 90000.0, atol=1e-9)
    assert told["timing"]["irregular_share"] > 0.5
    assert told["timing"]["longest_s"] == pytest.approx(np.diff(ticks).max() / 90000.0)


@pytest.mark.parametrize("codec", ["mjpeg", "mpeg4"])
def test_frames_that_an_avi_repeats_are_no_damage(codec: str, tmp_path: Path) -> None:
    # A recorder that drops a frame writes a chunk without bytes: what is declared counts them.
    kept = [number for number in range(RIG.frames) if number not in (5, 6, 11)]
    pictures = [picture for number, picture in enumerate(RIG.pictures()) if number in kept]
    pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
    path = write(tmp_path / "film.avi", pictures, codec, pix_fmt=pix_fmt, pts=lambda index: kept[index])
    source = open_source(path)
    assert source.frame_count == RIG.frames
    assert [round(frame.time_s * 30.0) for frame in source] == kept
    assert source.damage.entries == []


def test_an_avi_that_repeats_its_last_frame_too_is_not_cut(tmp_path: Path) -> None:
    # One that counts in sixtieths of a second at 30 frames a second repeats every frame.
    def prepare(stream: Any) -> None:
        stream.codec_context.time_base = Fraction(1, 60)

    path = write(tmp_path / "film.avi", RIG.pictures(), "mjpeg", pix_fmt="yuvj420p", prepare=prepare)
    source = open_source(path)
    assert source.frame_count == 2 * RIG.frames
    assert len(list(source)) == RIG.frames
    assert source.damage.entries == []


def test_timestamps_rounded_by_the_container_are_no_variable_rate(tmp_path: Path) -> None:
    # Matroska counts milliseconds: 240 frames a second are 4 or 5 of them.
    path = write(tmp_path / "film.mkv", [np.zeros((48, 64), np.uint8)] * 60, "libx264", fps=240)
    source = open_source(path)
    time_s = read_timestamps(source).time_s
    assert set(np.rint(np.diff(time_s) * 1e3).astype(int).tolist()) == {4, 5}
    assert timing(time_s, tick_s=source.describe()["tick_s"]).irregular_share == 0.0


@pytest.mark.parametrize("bframes", [0, 3])
def test_frames_that_an_edit_list_hides_are_no_damage(bframes: int, tmp_path: Path, monkeypatch: Any) -> None:
    options = {**CRISP, "g": "250", "bf": str(bframes)}
    path = write(tmp_path / "film.mp4", RIG.pictures(), "libx264", options=options, hidden=9)
    with av.open(str(path)) as container:
        packets = [packet for packet in container.demux(video=0) if packet.size]
    assert len(packets) == RIG.frames
    assert sum(packet.is_discard for packet in packets) == 9
    _, angles, told = track(path)
    check(angles, RIG.truth_deg[9:], within_deg=tolerance_deg(RIG))
    assert told["timing"]["frames"] == RIG.frames - 9
    assert told["timing"]["rate_fps"] == pytest.approx(30.0)
    assert told["timing"]["irregular_share"] == 0.0
    assert [event for event in told["events"] if event["kind"] == "damage"] == []
    source = open_source(path)
    decoded = read_timestamps(source)
    monkeypatch.setattr("tracker.frames.sample.DECODED_PX", 1.0)
    listed = read_timestamps(source)
    assert (decoded.decoded, listed.decoded, listed.hidden) == (True, False, 9)
    np.testing.assert_array_equal(listed.pts, decoded.pts)
    np.testing.assert_allclose(listed.time_s, decoded.time_s)


def test_a_stream_without_timestamps_is_gone_through_from_its_start(tmp_path: Path) -> None:
    path = write(tmp_path / "film.h264", RIG.pictures(), "libx264", options={**CRISP, "bf": "0"})
    source = open_source(path)
    timestamps = read_timestamps(source)
    assert len(timestamps) == RIG.frames
    whole = [frame.luma.copy() for frame in source if frame.luma is not None]
    for frame, luma in zip(Clip(source, timestamps, first=7, count=3), whole[7:10], strict=True):
        np.testing.assert_array_equal(frame.luma, luma)


def sound(path: Path) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), format="s16", layout="mono")
        frame.sample_rate = 8000
        for packet in (*stream.encode(frame), *stream.encode(None)):
            container.mux(packet)
    return path


def test_a_file_without_a_film_in_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"has no video stream; found audio"):
        open_source(sound(tmp_path / "sound.mov"))


def two_streams(path: Path, sizes: list[tuple[int, int]], *, cover: bool = False) -> Path:
    """Write a film with two video streams, the first of them a cover picture where ``cover`` is set."""
    with av.open(str(path), "w") as container:
        streams = []
        for number, (width, height) in enumerate(sizes):
            stream = container.add_stream("mjpeg" if cover and number == 0 else "libx264", rate=30)
            stream.width, stream.height = width, height
            stream.pix_fmt = "yuvj420p" if cover and number == 0 else "yuv420p"
            if cover and number == 0:
                stream.disposition = av.stream.Disposition.attached_pic
            streams.append(stream)
        for index in range(6):
            for number, stream in enumerate(streams):
                if cover and number == 0 and index:
                    continue
                picture = np.full((stream.height, stream.width), 40 * number + 90, np.uint8)
                frame = _frame(picture, stream.pix_fmt)
                frame.pts, frame.time_base = index, Fraction(1, 30)
                for packet in stream.encode(frame):
                    container.mux(packet)
        for stream in streams:
            for packet in stream.encode(None):
                container.mux(packet)
    return path


def test_of_two_streams_the_one_that_players_show_is_used_and_told(tmp_path: Path) -> None:
    source = open_source(two_streams(tmp_path / "film.mkv", [(160, 120), (320, 240)]))
    (entry,) = source.damage.entries
    assert entry["kind"] == "streams"
    assert "2 video streams (160 × 120, 320 × 240)" in entry["text"]
    width, height = source.size_px
    assert f"number {[(160, 120), (320, 240)].index((width, height))}," in entry["text"]
    assert {frame.luma.shape for frame in source if frame.luma is not None} == {(height, width)}


def test_a_cover_picture_is_no_film(tmp_path: Path) -> None:
    source = open_source(two_streams(tmp_path / "film.mp4", [(64, 48), (160, 120)], cover=True))
    assert source.size_px == (160, 120)
    assert source.damage.entries == []
    assert sum(frame.luma is not None for frame in source) == 6


def test_a_size_that_changes_within_a_film_is_refused(tmp_path: Path) -> None:
    parts = [replace(RIG, frames=8), replace(RIG, frames=8, size=(240, 180), base_px=(20, 50), moving_px=(20, 50))]
    files = [
        write(tmp_path / f"{number}.h264", part.pictures(), "libx264", options={**CRISP, "bf": "0"})
        for number, part in enumerate(parts)
    ]
    joined = tmp_path / "film.h264"
    joined.write_bytes(b"".join(file.read_bytes() for file in files))
    source = open_source(joined)
    with pytest.raises(InputError, match=r"frame 8.*changes its picture size.*240 × 180.*320 × 240"):
        list(source)
    with pytest.raises(InputError, match="changes its picture size"):
        read_timestamps(source)


def test_a_lossless_film_written_elsewhere_has_no_remarks(tmp_path: Path) -> None:
    assert track(write_film(RIG, tmp_path / "film.mkv"))[0].damage == []
