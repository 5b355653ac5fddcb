"""What can be watched: a camera behind OpenCV's boundary, a stream on this computer, films and their pace."""

from __future__ import annotations

import socket
import threading
import time
from itertools import pairwise
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from live_rig import FPS, SIZE_PX, write_film

from torsight.core.errors import ConfigError, InputError
from torsight.viewer.live.frames import sources as sources_module
from torsight.viewer.live.frames.intake import Intake, Picture, comes_in_time
from torsight.viewer.live.frames.sources import film_of, open_pictures
from torsight.viewer.program import free_port

PERIOD_S = 0.01
RATE_HZ = 1.0 / PERIOD_S


class FakeCapture:
    """A camera behind OpenCV's boundary: pictures on a clock of its own, some lost, then silence."""

    def __init__(
        self, *, there: bool = True, lost: tuple[int, ...] = (), timestamps: bool = True, count: int = 40
    ) -> None:
        self.there, self.timestamps = there, timestamps
        self.taken = [number for number in range(count) if number not in lost]
        self.begin_s = time.perf_counter()
        self.current = -1
        self.released = False

    def isOpened(self) -> bool:  # noqa: N802 - OpenCV's name
        return self.there

    def grab(self) -> bool:
        if not self.taken:
            return False
        self.current = self.taken.pop(0)
        time.sleep(max(0.0, self.begin_s + self.current * PERIOD_S - time.perf_counter()))
        return True

    def retrieve(self) -> tuple[bool, np.ndarray | None]:
        if self.current == 7:
            return False, None
        return True, np.full((6, 8, 3), self.current, np.uint8)

    def get(self, prop: int) -> float:
        if prop != cv2.CAP_PROP_POS_MSEC or not self.timestamps:
            return 0.0
        return 1e3 * (self.begin_s + self.current * PERIOD_S)

    def release(self) -> None:
        self.released = True


@pytest.fixture
def plugged(monkeypatch: pytest.MonkeyPatch) -> list[FakeCapture]:
    """Put a fake camera, to be filled in by the test, where OpenCV's would be."""
    cameras: list[FakeCapture] = []
    monkeypatch.setattr(sources_module, "open_capture", lambda _number, _fps: cameras[0])
    monkeypatch.setattr(sources_module, "SILENT_S", 0.1)
    return cameras


def all_of(source: str, **options: float) -> tuple[list[Picture], str]:
    pictures = open_pictures(source, **options)
    return list(pictures.frames(threading.Event())), pictures.ended_because


@pytest.mark.usefixtures("plugged")
def test_a_cameras_times_are_those_of_its_driver(plugged: list[FakeCapture]) -> None:
    plugged.append(FakeCapture())
    pictures, why = all_of("0")
    np.testing.assert_allclose([one.time_s for one in pictures], PERIOD_S * np.arange(40), atol=1e-9)
    assert [None if one.luma is None else int(one.luma[0, 0]) for one in pictures] == [
        None if number == 7 else number for number in range(40)
    ]
    assert pictures[7].damaged
    assert all(one.missed == 0 for one in pictures)
    assert "no picture" in why
    assert plugged[0].released


def test_pictures_that_a_camera_loses_are_counted_and_shift_no_time(plugged: list[FakeCapture]) -> None:
    plugged.append(FakeCapture(lost=(20, 21, 30)))
    pictures, _ = all_of("0")
    assert len(pictures) == 37
    at = {round(one.time_s / PERIOD_S): one for one in pictures}
    assert {number: one.missed for number, one in at.items() if one.missed} == {22: 2, 31: 1}
    np.testing.assert_allclose(
        [one.time_s for one in pictures], [PERIOD_S * number for number in sorted(at)], atol=1e-9
    )


def test_a_driver_without_timestamps_gives_the_times_of_arrival(plugged: list[FakeCapture]) -> None:
    plugged.append(FakeCapture(timestamps=False))
    pictures, _ = all_of("0")
    times = [one.time_s for one in pictures]
    assert times[0] == 0.0
    assert all(later > earlier for earlier, later in pairwise(times))
    # None can arrive before it is taken.
    assert times[-1] - times[1] >= 0.5 * 38 * PERIOD_S


def test_an_absent_camera_is_named_with_what_to_do(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InputError, match=r"camera 97: there is no camera of this number.*plug it in"):
        open_pictures("97")
    assert capfd.readouterr().err == ""


# --- streams ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("rtsp://192.168.0.7/stream", "another computer"),
        ("http://cameras.example/feed", "another computer"),
        ("tcp://0.0.0.0:5000?listen=1", "another computer"),
        ("udp://@:5000", "would listen to other computers"),
        ("udp://:5000", "would listen to other computers"),
        ("rtp://127.0.0.1:5000", "no stream that can be watched.*rtsp://"),
        ("ftp://127.0.0.1/film.mkv", "no stream that can be watched"),
    ],
)
def test_a_stream_that_leaves_this_computer_is_refused(source: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        open_pictures(source)


def send_over_udp(port: int, ended: threading.Event) -> None:
    """Send moving pictures as a camera's program would."""
    with av.open(f"udp://127.0.0.1:{port}?pkt_size=1316", "w", format="mpegts") as container:
        stream = container.add_stream("mpeg2video", rate=25)
        stream.width, stream.height, stream.pix_fmt, stream.gop_size = 64, 48, "yuv420p", 5
        number = 0
        while not ended.is_set():
            luma = np.full((72, 64), 128, np.uint8)
            luma[:48] = 16 + 5 * (number % 40)
            frame = av.VideoFrame.from_ndarray(luma, format="yuv420p")
            frame.pts = number
            container.mux(stream.encode(frame))
            number += 1
            ended.wait(0.01)


def test_a_stream_is_watched_through_a_port_of_this_computer_only() -> None:
    port, ended, stop = free_port(), threading.Event(), threading.Event()
    sender = threading.Thread(target=send_over_udp, args=(port, ended), daemon=True)
    sender.start()
    pictures, listening = [], []
    try:
        for picture in open_pictures(f"udp://127.0.0.1:{port}").frames(stop):
            pictures.append(picture)
            if len(pictures) == 20:
                listening = udp_addresses(port)
                break
    finally:
        ended.set()
        sender.join()
    assert len(pictures) == 20
    assert pictures[0].time_s == 0.0
    # Its own timestamps, 25 a second, though it is sent faster.
    np.testing.assert_allclose(np.diff([one.time_s for one in pictures]), 1.0 / 25.0, atol=1e-3)
    assert pictures[0].luma is not None
    assert pictures[0].luma.shape == (48, 64)
    if Path("/proc/net/udp").exists():
        assert listening == ["0100007F"]


def udp_addresses(port: int) -> list[str]:
    """Return the addresses of this computer at which the port is bound, as the system writes them."""
    places = [line.split()[1].split(":") for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
    return [address for address, number in places if int(number, 16) == port]


def test_a_stream_that_nobody_sends_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources_module, "SILENT_S", 0.3)
    with pytest.raises(InputError, match=r"udp://127\.0\.0\.1.*gave no picture within 0\.3 s"):
        all_of(f"udp://127.0.0.1:{free_port()}")
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
    with pytest.raises(InputError, match=r"cannot be read.*whatever sends it"):
        all_of(f"tcp://127.0.0.1:{port}")


# --- films ------------------------------------------------------------------------------------------------------------


def test_a_film_plays_at_its_own_speed_or_faster(tmp_path: Path) -> None:
    write_film(tmp_path / "film.mkv", 16)
    for speed in (1.0, 4.0):
        intake = Intake(open_pictures(str(tmp_path / "film.mkv"), speed=speed))
        intake.start()
        intake.go()
        arrived = []
        while not intake.ended:
            frame = intake.take(0.1)
            if frame is not None:
                arrived.append(frame.arrived_s)
        assert len(arrived) == 16
        # A frame is never early; how late one may be is the machine's affair.
        early = (arrived[1] + (np.arange(15) / (FPS * speed))) - np.array(arrived[1:])
        assert early.max() < 1e-3


def test_only_what_comes_as_a_rig_moves_is_in_a_hurry(tmp_path: Path, plugged: list[FakeCapture]) -> None:
    """A film in fast motion would keep every other program from the processor."""
    write_film(tmp_path / "film.mkv", 2)
    plugged.append(FakeCapture())
    film = str(tmp_path / "film.mkv")
    assert comes_in_time(open_pictures("0"))
    assert comes_in_time(open_pictures("udp://127.0.0.1:5000"))
    assert comes_in_time(open_pictures(film))
    assert not comes_in_time(open_pictures(film, speed=50.0))
    assert not comes_in_time(open_pictures(film, grows=True))


def test_what_is_watched_knows_its_film(tmp_path: Path, plugged: list[FakeCapture]) -> None:
    write_film(tmp_path / "film.mkv", 2)
    plugged.append(FakeCapture())
    assert film_of(open_pictures(str(tmp_path / "film.mkv"))) == str(tmp_path / "film.mkv")
    assert film_of(open_pictures(str(tmp_path / "film.mkv"), grows=True)) == str(tmp_path / "film.mkv")
    assert film_of(open_pictures("0")) is None
    assert open_pictures(str(tmp_path / "film.mkv")).describe()["width_px"] == SIZE_PX[0]
