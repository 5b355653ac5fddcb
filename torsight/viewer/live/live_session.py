"""One live record: frames in, angle out, with the log; both are on disk, and as far as time permits on the screen."""

from __future__ import annotations

import gc
import math
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from torsight.core.errors import NoResultError
from torsight.core.files.storage import write_json
from torsight.core.optics.camera import Camera, require_size
from torsight.core.progress import AT_ONCE_S, ATTENTION_S, THOUGHT_S
from torsight.core.units import DEG
from torsight.core.words.wording import estimate
from torsight.viewer import view_layout
from torsight.viewer.film_preview import WIDEST_PX
from torsight.viewer.live.frames.intake import WAITING_FRAMES, Intake, Picture, Pictures, comes_in_time
from torsight.viewer.live.measure.growing_log import LogClock, LogFollower, WatchedLog
from torsight.viewer.live.measure.model_watch import ModelNews, ModelWatch
from torsight.viewer.live.measure.tracking import LiveTracker, Seen, warm_up
from torsight.viewer.live.measure.which_markers import UNDECIDED
from torsight.viewer.live.priority import TRACKING, quick_turns, served_first
from torsight.viewer.live.record import Outcome, Recorder, finish, standing, write_track_account
from torsight.viewer.live.screen import Feed, Latency
from torsight.viewer.overlay import overlay
from tracker.detect.dots import HUGE_PX
from tracker.detect.marker_file import MarkerHints

PICTURES_HZ: Final = 1.5 / AT_ONCE_S
"""Pictures per second that are shown, half as many again as look like motion; every frame is measured."""
LOG_EVERY_S: Final = AT_ONCE_S
"""Interval at which the log is read for new rows."""
MODEL_EVERY_S: Final = THOUGHT_S
"""Interval at which the model's results are polled and the summary is updated."""
STOPPED_FIT_S: Final = 0.5 * ATTENTION_S
"""Time that a record which is ended by hand waits for the model's last results."""
FEED_OPENS_S: Final = 1.5 * ATTENTION_S
"""Time that the first frame waits for the viewer's side to be ready; after it, when a person would begin to wonder, the
record begins without the viewer."""
_WARNINGS: Final = ("occlusion", "lost", "dropped", "log")


class Session:
    """A live record from its first frame to its summary: the source, its temperature log, and the record's folder.

    ``feed`` is the screen, ``model`` the model that is computed meanwhile; ``say`` takes a line for the terminal.
    """

    def __init__(
        self,
        pictures: Pictures,
        log: WatchedLog,
        *,
        folder: Path,
        hints: MarkerHints | None = None,
        camera: Camera | None = None,
        feed: Feed | None = None,
        model: ModelWatch | None = None,
        say: Callable[[str], None] = lambda _line: None,
    ) -> None:
        self.outcome = Outcome()
        self._camera = camera
        self._feed, self._model, self._say = feed, model, say
        self._folder = folder
        self._events: list[dict[str, Any]] = []
        self.now_s = 0.0
        """Time of the last frame."""
        self._frame = 0
        self._size_px: tuple[int, int] = (0, 0)
        self._intake = Intake(pictures)
        self._tracker = LiveTracker(
            hints, camera, name=pictures.name, tell=self._tell, pixel_aspect=pictures.pixel_aspect
        )
        self._recorder = Recorder(folder, in_space=camera is not None and camera.pose is not None)
        self._follower = LogFollower(
            log.path, lambda words: self._tell(self.now_s, self._frame, "log", words), log.columns
        )
        self._clock = LogClock(log.offset_s)
        self._latency = Latency()
        self._due = dict.fromkeys(("picture", "beside", "log", "model", "dropped"), -math.inf)
        self._told_dropped = 0
        self._angle_deg = math.nan
        self._model_deg = math.nan, math.nan
        self._temperatures: dict[str, float] = {}
        self._trouble = ""
        self.steady = False
        """Whether the markers are found and no frames are waiting: latency is counted from then on."""
        self._closed = False

    def run(self, stop: threading.Event) -> Outcome:
        """Measure until the source ends or ``stop`` is set, then complete the record.

        An error of the source, the log or the disk is raised; the record up to then is kept.
        """
        warm_up()
        if self._feed is not None:
            # Otherwise the first frames would wait for a viewer's side that is still loading.
            self._feed.wait_until_open(FEED_OPENS_S)
        self._poll_log(early=True)
        # All objects that exist by now stay for the whole record: later garbage collections need not look at them.
        gc.collect()
        gc.freeze()
        self._intake.start()
        try:
            hurry = comes_in_time(self._intake.pictures)
            with served_first(TRACKING, wanted=hurry) as first, quick_turns():
                self.outcome.served_first = first
                self._watch(stop)
            self._poll_log()
            self._tell_dropped()
            if self._intake.pictures.ended_because:
                self._tell(self.now_s, self._frame, "lost", f"the source ended: {self._intake.pictures.ended_because}")
            # A person who ends the record does not want to wait long.
            self._last_news(STOPPED_FIT_S if stop.is_set() else math.inf)
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
                limit=f"round dots of 3 to {HUGE_PX:g} px radius",
                do="give their positions with --markers MARKERS.toml, or light the sticks better",
            )
        return self.outcome

    def _watch(self, stop: threading.Event) -> None:
        """Take frame after frame until the source ends or ``stop`` is set."""
        while not stop.is_set():
            frame = self._intake.take(0.05)
            if frame is not None:
                self._take(frame)
            elif self._intake.ended:
                break
            self._recorder.flush_due()
            self._settle()
            if self._intake.waiting == 0 or time.perf_counter() > self._due["beside"]:
                self._due["beside"] = time.perf_counter() + LOG_EVERY_S
                self._beside()

    # --- each frame -------------------------------------------------------------------------------------------------

    def _take(self, frame: Picture) -> None:
        self.now_s, self._frame = frame.time_s, frame.index
        self._look_at_size(frame)
        seen = self._tracker.step(frame)
        self._take_earlier()
        self._recorder.frame(frame.index, frame.time_s, seen)
        self._show(frame, seen)
        self._intake.go()
        if self.steady and not frame.dropped:
            self._latency.add(time.perf_counter() - frame.arrived_s)
        self._angle_deg = seen.angle_rad / DEG
        self.outcome.count(seen.angle_rad, dropped=frame.dropped, missed=frame.missed)
        if self._model is not None and math.isfinite(seen.angle_rad):
            self._model.angle(frame.time_s, seen.angle_rad, seen.sigma_rad)

    def _take_earlier(self) -> None:
        """Show, and give to the model, the angles of the frames before the moving stick was known."""
        earlier = self._tracker.earlier()
        if self._tracker.anew:
            self._tracker.anew = False
            if self._model is not None:
                self._model.begin_again()
        if not earlier:
            return
        time_s = np.array([one.time_s for one in earlier])
        self._put("series", "angle/measured", time_s, np.array([one.angle_rad / DEG for one in earlier]))
        if self._model is not None:
            for one in earlier:
                self._model.angle(one.time_s, one.angle_rad, one.sigma_rad)

    def _look_at_size(self, frame: Picture) -> None:
        if frame.luma is None:
            return
        size_px = (frame.luma.shape[1], frame.luma.shape[0])
        if size_px != self._size_px and self._camera is not None:
            require_size(self._camera, size_px, film="the film")
        self._size_px = size_px

    def _show(self, frame: Picture, seen: Seen) -> None:
        if self._feed is None:
            return
        counts = self.steady and not frame.dropped
        self._feed.put("angle", frame.time_s, frame.index, seen.angle_rad / DEG, frame.arrived_s if counts else None)
        if frame.luma is not None and frame.arrived_s >= self._due["picture"]:
            self._due["picture"] = frame.arrived_s + 1.0 / PICTURES_HZ
            # Every second or third pixel of a large picture is enough for the display.
            stride = max(1, math.ceil(frame.luma.shape[1] / WIDEST_PX))
            luma = np.ascontiguousarray(frame.luma[::stride, ::stride])
            drawn = overlay(seen.position_px, seen.angle_rad, scale=1.0 / stride)
            self._feed.put("picture", frame.time_s, frame.index, luma, drawn)
            for side, entity in view_layout.BAND.items():
                band_deg = side * seen.sigma_rad / DEG
                self._feed.put("series", entity, np.array([frame.time_s]), np.array([band_deg]))

    def _settle(self) -> None:
        """Count latency once the markers are found and the frames that waited for the search have been processed."""
        if self.steady or not self._tracker.found:
            return
        waits = self._intake.pictures.waits
        if waits or self._intake.waiting == 0:
            self._intake.hurry()
            self.steady = self._intake.waiting <= (WAITING_FRAMES if waits else 0)

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
            self._put("summary", self._words())
        if now >= self._due["dropped"]:
            self._due["dropped"] = now + 5.0  # a line now and then, not one for each
            self._tell_dropped()

    def _poll_log(self, *, early: bool = False) -> None:
        rows = self._follower.poll()
        if rows:
            self._recorder.log(self._follower.header, [row.text for row in rows])
        self.outcome.log_rows += len(rows)
        self._clock.rows([row.numbers for row in rows], now_s=None if early else self.now_s)
        due = self._clock.due(self.now_s)
        if not due:
            return
        times = np.array([time_s for time_s, _ in due])
        values = np.array([row[1:3] for _, row in due])
        self._temperatures = {"A": float(values[-1, 0]), "B": float(values[-1, 1])}
        for place, entity in enumerate(("temperature/a", "temperature/b")):
            self._put("series", entity, times, values[:, place])
        if self._model is not None:
            for time_s, row in due:
                self._model.temperature(time_s, tuple(row[1:]))

    def _last_news(self, limit_s: float) -> None:
        if self._model is not None and self.outcome.measured:
            if self.outcome.log_rows:
                self._say("fitting the friction of the whole record")
            for news in self._model.last(min(limit_s, self._model.last_fit_s)):
                self._news(news)
            if self.outcome.friction is None:
                self._say(f"no friction torque: {self._trouble or self._model.why_no_fit()}")
        self._put("summary", self._words())

    def _news(self, news: ModelNews | None) -> None:
        if news is None:
            return
        self._trouble = news.trouble
        self._tell_half_cycles(news)
        if len(news.time_s):
            self._model_deg = news.angle_rad[-1] / DEG, news.residual_rad[-1] / DEG
            self._put("series", "angle/plain", news.time_s, news.angle_rad / DEG)
            known = np.isfinite(news.residual_rad)
            self._put("series", "residual/before", news.time_s[known], news.residual_rad[known] / DEG)
        if news.friction is not None:
            self.outcome.friction = news.friction
            self._tell(self.now_s, self._frame, "friction", f"friction torque so far {estimate(news.friction)}")

    def _tell_dropped(self) -> None:
        outcome = self.outcome
        if outcome.dropped + outcome.missed > self._told_dropped:
            self._told_dropped = outcome.dropped + outcome.missed
            self._tell(self.now_s, self._frame, "dropped", f"{outcome.dropped} frames dropped so far{outcome.lost}")

    def _tell_half_cycles(self, news: ModelNews) -> None:
        for begin in news.half_cycles[self.outcome.half_cycles :]:
            self.outcome.half_cycles += 1
            words = f"number {self.outcome.half_cycles}, spring {begin.spring} is driven"
            self._tell(begin.time_s, self._frame, "half-cycle", words)
            if math.isfinite(begin.angle_deg):
                at = np.array([begin.time_s]), np.array([begin.angle_deg])
                self._put("series", view_layout.HALF_CYCLE, *at)

    def _words(self) -> str:
        return standing(
            self.outcome,
            angle_deg=self._angle_deg,
            model_deg=self._model_deg,
            temperatures=self._temperatures,
            latency_ms=self._latency.percentile_ms(50.0),
            trouble=self._trouble,
            markers=UNDECIDED if self._tracker.undecided else "",
        )

    def _tell(self, time_s: float, frame: int, kind: str, text: str) -> None:
        self._events.append({"time_s": time_s, "frame": frame, "kind": kind, "text": text})
        if not self._closed:
            self._recorder.event(time_s, frame, kind, text)
        self._say(f"{time_s:9.2f} s  {kind}: {text}")
        self._put("event", time_s, "WARN" if kind in _WARNINGS else "INFO", f"{kind}: {text}")

    def _put(self, kind: str, *entry: Any) -> None:
        """Send an entry to the screen, if there is one."""
        if self._feed is not None:
            self._feed.put(kind, *entry)

    # --- the end ----------------------------------------------------------------------------------------------------

    def _end(self) -> None:
        """Close the files, and complete the record as ``torsight track`` would for a film."""
        outcome, pictures = self.outcome, self._intake.pictures
        self._follower.close()
        self._recorder.close()
        self._closed = True
        outcome.latency = self._latency.to_json()
        if self._feed is not None:
            outcome.left_out = self._feed.left_out
            outcome.latency_logged = self._feed.latency.to_json()
        orientation = finish(
            self._folder,
            camera=self._camera,
            size_px=self._size_px,
            tracker=self._tracker,
            pixel_aspect=pictures.pixel_aspect,
        )
        if orientation is not None:
            outcome.settle(orientation.angles)
        write_track_account(
            self._folder, source=pictures.describe(), outcome=outcome, orientation=orientation, events=self._events
        )
        write_json(
            self._folder / "live.json",
            {
                "latency": outcome.latency,
                "latency_logged": outcome.latency_logged,
                "measuring_served_first": outcome.served_first,
                "frames": outcome.frames,
                "frames_dropped": outcome.dropped,
                "frames_missed": outcome.missed,
                "entries_not_shown": outcome.left_out,
                "log_rows": outcome.log_rows,
                "log_lines_refused": self._follower.refused,
                "offset_s": self._clock.offset_s,
                "half_cycles": outcome.half_cycles,
                "friction": outcome.friction,
            },
        )
