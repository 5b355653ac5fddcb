"""One live record: frames in, angle out, log beside it, both on disk, and on the screen what can be shown."""

from __future__ import annotations

import gc
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from torsight.core.errors import NoResultError
from torsight.core.tracks import MARKERS
from torsight.core.units import DEG
from torsight.core.wording import estimate, number
from torsight.viewer.live.disk import Recorder, finish, write_account
from torsight.viewer.live.following import LogFollower
from torsight.viewer.live.intake import Intake, LiveFrame, Pictures
from torsight.viewer.live.latency import Latency
from torsight.viewer.live.tracking import LiveTracker, Seen, warm_up
from torsight.viewer.overlay import overlay

if TYPE_CHECKING:
    from torsight.core.camera import Camera
    from torsight.viewer.live.feed import Feed
    from torsight.viewer.live.model import ModelNews, ModelWatch
    from tracker.hints import MarkerHints

PICTURES_HZ: Final = 15.0
"""Pictures per second that are shown; every frame is measured."""
LOG_EVERY_S: Final = 0.1
MODEL_EVERY_S: Final = 1.0
SHOWN_PX: Final = 640
_WARNINGS: Final = ("occlusion", "lost", "dropped", "log")


@dataclass(slots=True)
class Outcome:
    """How a live record ended, for the summary."""

    frames: int = 0
    measured: int = 0
    dropped: int = 0
    left_out: int = 0
    log_rows: int = 0
    low_deg: float = math.inf
    high_deg: float = -math.inf
    friction: dict[str, Any] | None = None
    latency: dict[str, Any] = field(default_factory=dict)


class Session:
    """A live record from its first frame to its summary.

    Parameters
    ----------
    pictures : Pictures
        What is watched.
    log : Path
        The temperature log; it may come later.
    folder : Path
        Where the record goes.
    hints, camera : optional
        Marker positions in the first frame; calibrated camera.
    feed : Feed or None
        The screen.
    model : ModelWatch or None
        The model beside.
    offset_s : float or None
        Temperature log's time less film time; None: taken from when rows arrive.
    say : callable
        Takes a line for the person at the terminal.
    """

    def __init__(
        self,
        pictures: Pictures,
        *,
        log: Path,
        folder: Path,
        hints: MarkerHints | None = None,
        camera: Camera | None = None,
        feed: Feed | None = None,
        model: ModelWatch | None = None,
        offset_s: float | None = None,
        say: Callable[[str], None] = lambda _line: None,
    ) -> None:
        self.outcome = Outcome()
        self._camera = camera
        self._feed, self._model, self._say = feed, model, say
        self._folder = folder
        self._events: list[dict[str, Any]] = []
        self._now_s = 0.0
        self._frame = 0
        self._size_px: tuple[int, int] = (0, 0)
        self._intake = Intake(pictures)
        self._tracker = LiveTracker(hints, camera, name=pictures.name, tell=self._tell)
        self._recorder = Recorder(folder, in_space=camera is not None and camera.pose is not None)
        self._follower = LogFollower(log, lambda words: self._tell(self._now_s, self._frame, "log", words))
        self._clock = LogClock(offset_s)
        self._latency = Latency()
        self._due = dict.fromkeys(("picture", "log", "model", "dropped"), -math.inf)
        self._told_dropped = 0
        self._angle_deg = math.nan
        self._temperatures: dict[str, float] = {}
        self._trouble = ""
        self._steady = False

    def run(self, stop: threading.Event) -> Outcome:
        """Measure until the source ends or ``stop`` is set, then make the record whole.

        Raises
        ------
        TorsightError
            What the source, the log or the disk refuses; the record so far is kept.
        """
        warm_up()
        self._poll_log(early=True)
        # Everything that exists by now stays; no later collection need go through it.
        gc.collect()
        gc.freeze()
        self._intake.start()
        try:
            while not stop.is_set():
                frame = self._intake.take(0.05)
                if frame is not None:
                    self._take(frame)
                elif self._intake.ended:
                    break
                self._recorder.flush_due()
                if self._intake.waiting == 0:
                    self._caught_up()
                    self._beside()
            if self._intake.error is not None:
                raise self._intake.error
        finally:
            self._intake.stop()
            gc.unfreeze()
            self._end()
        if not self._tracker.found and self.outcome.frames:
            raise NoResultError(
                "four markers, two dots on each of two sticks, were not seen",
                where=self._intake.pictures.name,
                limit="round dots of 3 to 20 px radius",
                do="give their positions with --markers MARKERS.toml, or light the sticks better",
            )
        return self.outcome

    # --- each frame -------------------------------------------------------------------------------------------------

    def _take(self, frame: LiveFrame) -> None:
        self._now_s, self._frame = frame.time_s, frame.index
        if frame.luma is not None:
            self._size_px = (frame.luma.shape[1], frame.luma.shape[0])
        seen = self._tracker.step(frame)
        self._recorder.frame(
            frame.index,
            frame.time_s,
            angle_rad=seen.angle_rad,
            sigma_rad=seen.sigma_rad,
            position_px=seen.position_px,
            covariance_px2=seen.covariance_px2,
            position_mm=seen.position_mm,
        )
        self._show(frame, seen)
        self._intake.go()
        if self._steady and not frame.dropped:
            self._latency.add(time.perf_counter() - frame.arrived_s)
        self._count(frame, seen)
        if self._model is not None and math.isfinite(seen.angle_rad):
            self._model.angle(frame.time_s, seen.angle_rad, seen.sigma_rad)

    def _count(self, frame: LiveFrame, seen: Seen) -> None:
        outcome = self.outcome
        self._angle_deg = seen.angle_rad / DEG
        outcome.frames += 1
        outcome.dropped += frame.dropped
        if math.isfinite(seen.angle_rad):
            degrees = seen.angle_rad / DEG
            outcome.measured += 1
            outcome.low_deg, outcome.high_deg = min(outcome.low_deg, degrees), max(outcome.high_deg, degrees)

    def _show(self, frame: LiveFrame, seen: Seen) -> None:
        if self._feed is None:
            return
        luma, drawn = None, None
        if frame.luma is not None and frame.arrived_s >= self._due["picture"]:
            self._due["picture"] = frame.arrived_s + 1.0 / PICTURES_HZ
            # Every second or third pixel of a large picture is enough to look at.
            stride = max(1, math.ceil(frame.luma.shape[1] / SHOWN_PX))
            luma = np.ascontiguousarray(frame.luma[::stride, ::stride])
            drawn = overlay(seen.position_px, seen.angle_rad, names=MARKERS, scale=1.0 / stride)
        self._feed.put("frame", frame.time_s, frame.index, seen.angle_rad / DEG, luma, drawn)

    def _caught_up(self) -> None:
        """Count latency from where the markers are found and the frames that waited for it have been taken."""
        if not self._steady and self._tracker.found:
            self._steady = True
            self._intake.hurry()

    # --- beside the frames ------------------------------------------------------------------------------------------

    def _beside(self) -> None:
        now = time.perf_counter()
        if now >= self._due["log"]:
            self._due["log"] = now + LOG_EVERY_S
            self._poll_log()
        if now >= self._due["model"]:
            self._due["model"] = now + MODEL_EVERY_S
            if self._model is not None:
                self._news(self._model.poll())
            if self._feed is not None:
                self._feed.put("summary", self._words())
        if self.outcome.dropped > self._told_dropped and now >= self._due["dropped"]:
            self._due["dropped"] = now + 5.0
            self._told_dropped = self.outcome.dropped
            self._tell(self._now_s, self._frame, "dropped", f"{self._told_dropped} frames dropped so far")

    def _poll_log(self, *, early: bool = False) -> None:
        rows = self._follower.poll()
        if rows:
            self._recorder.log(self._follower.header, [row.text for row in rows])
        self.outcome.log_rows += len(rows)
        self._clock.rows([row.values for row in rows], now_s=None if early else self._now_s)
        due = self._clock.due(self._now_s)
        if not due:
            return
        times = np.array([time_s for time_s, _ in due])
        values = np.array([row[1:3] for _, row in due])
        self._temperatures = {"A": float(values[-1, 0]), "B": float(values[-1, 1])}
        if self._feed is not None:
            for place, entity in enumerate(("temperature/a", "temperature/b")):
                self._feed.put("series", entity, times, values[:, place])
        if self._model is not None:
            for time_s, row in due:
                self._model.temperature(time_s, tuple(row[1:]))

    def _news(self, news: ModelNews | None) -> None:
        if news is None:
            return
        self._trouble = news.trouble
        if self._feed is not None and len(news.time_s):
            self._feed.put("series", "angle/plain", news.time_s, news.angle_rad / DEG)
            known = np.isfinite(news.residual_rad)
            self._feed.put("series", "residual/before", news.time_s[known], news.residual_rad[known] / DEG)
        if news.friction is not None:
            self.outcome.friction = news.friction
            self._tell(self._now_s, self._frame, "friction", f"friction torque so far {estimate(news.friction)}")

    def _words(self) -> str:
        """Return how things stand, in Markdown."""
        outcome, angle = self.outcome, self._angle_deg
        rows = [
            ("Angle", f"{angle:.1f}°" if math.isfinite(angle) else "not known yet"),
            ("Temperatures", "  ".join(f"{name} {value:.1f} °C" for name, value in self._temperatures.items())),
            ("Range of motion", f"{outcome.high_deg - outcome.low_deg:.1f}°" if outcome.measured else "–"),
            ("Frames", f"{outcome.frames}, {outcome.measured} measured, {outcome.dropped} dropped"),
            ("Latency", f"median {number(self._latency.percentile_ms(50.0), 2)} ms"),
        ]
        if outcome.friction is not None:
            rows.append(("Friction torque", f"{estimate(outcome.friction)}, plain model"))
        if self._trouble:
            rows.append(("Model", self._trouble))
        return "\n".join(["### Live", "", *(f"- **{name}** {words or 'none yet'}" for name, words in rows), ""])

    def _tell(self, time_s: float, frame: int, kind: str, text: str) -> None:
        self._events.append({"time_s": time_s, "frame": frame, "kind": kind, "text": text})
        self._say(f"{time_s:9.2f} s  {kind}: {text}")
        if self._feed is not None:
            level = "WARN" if kind in _WARNINGS else "INFO"
            self._feed.put("event", time_s, level, f"{kind}: {text}")

    # --- the end ----------------------------------------------------------------------------------------------------

    def _end(self) -> None:
        """Close what is open, and make the record what ``torsight track`` would have made of a film."""
        self._follower.close()
        self._recorder.close()
        self.outcome.latency = self._latency.to_json()
        if self._feed is not None:
            self.outcome.left_out = self._feed.left_out
        orientation = finish(self._folder, camera=self._camera, size_px=self._size_px, swapped=self._tracker.swapped)
        report = {} if orientation is None else orientation.report
        about = {"source": self._intake.pictures.describe(), "frames": self.outcome.frames, **report}
        about["frames_dropped"] = self.outcome.dropped
        write_account(self._folder, "track.json", {**about, "events": self._events})
        write_account(
            self._folder,
            "live.json",
            {
                "latency": self.outcome.latency,
                "frames": self.outcome.frames,
                "frames_dropped": self.outcome.dropped,
                "entries_not_shown": self.outcome.left_out,
                "log_rows": self.outcome.log_rows,
                "log_lines_refused": self._follower.refused,
                "offset_s": self._clock.offset_s,
                "friction": self.outcome.friction,
            },
        )


class LogClock:
    """From the log's clock to the film's while both run.

    A row cannot arrive before it was written: the largest difference between a row's stamp and the film's time at its
    arrival is the offset, to within the shortest delay. Rows that lie there at the start say nothing; they are taken
    to be of the film's clock until a row arrives.

    Parameters
    ----------
    offset_s : float or None
        Log's time less film's time, where it is known.
    """

    def __init__(self, offset_s: float | None) -> None:
        self.offset_s = 0.0 if offset_s is None else offset_s
        self._fixed = offset_s is not None
        self._heard = False
        self._waiting: deque[tuple[float, ...]] = deque()

    def rows(self, rows: list[tuple[float, ...]], *, now_s: float | None) -> None:
        """Take rows that arrived at film time ``now_s``; None: they were there before."""
        self._waiting.extend(row for row in rows if math.isfinite(row[0]))
        if self._fixed or now_s is None or not rows:
            return
        newest = rows[-1][0] - now_s
        self.offset_s = newest if not self._heard else max(self.offset_s, newest)
        self._heard = True

    def due(self, now_s: float) -> list[tuple[float, tuple[float, ...]]]:
        """Return the rows whose time has come, with their times on the film's clock."""
        found = []
        while self._waiting and self._waiting[0][0] - self.offset_s <= now_s + 1e-9:
            row = self._waiting.popleft()
            found.append((row[0] - self.offset_s, row))
        return found
