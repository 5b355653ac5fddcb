"""A track that is stopped at any instant, any number of times, ends in the same bytes: with one film and with two."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.tracker.films import Cover, Rig, write_film
from tracker.checkpoint import RowStore
from tracker.follow.follower import Follower

OUTPUTS = ("angle.csv", "markers.csv", "track.json")
# Fast, shaken, through a crossing, with a hand over it for a while: state of every kind has to come back.
RIG = Rig(
    lambda t: 100.0 - 160.0 * t,
    frames=32,
    shake_px=1.0,
    tilt_deg=(6.0, -9.0),
    distance=500.0,
    covers=[Cover(0.75, 0.92, "moving")],
)


@contextmanager
def stopped_after(frames: int) -> Iterator[None]:
    """Let Ctrl-C come after some frames, anywhere between two checkpoints."""
    step, left = Follower.step, [frames]

    def counted(self: Follower, frame: object) -> object:
        if left[0] == 0:
            raise KeyboardInterrupt
        left[0] -= 1
        return step(self, frame)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Follower, "step", counted)
        patch.setattr(RowStore, "due", property(lambda self: len(self.rows()) % 4 == 3))
        yield


@pytest.mark.parametrize("films", [1, 2])
def test_stopped_at_random_instants(tmp_path: Path, films: int) -> None:
    from torsight.cli.track import track_to_folder

    right = replace(RIG, tilt_deg=(4.0, 12.0), seed=9)
    options: dict[str, object] = {"markers": tmp_path / "markers.toml"}
    (tmp_path / "markers.toml").write_text(RIG.markers_toml())
    film = write_film(RIG, tmp_path / "left.mkv")
    if films == 2:
        (tmp_path / "pair.toml").write_text(RIG.pair_toml(right))
        options |= {"right": write_film(right, tmp_path / "right.mkv"), "camera": tmp_path / "pair.toml"}
    track_to_folder(film, out=tmp_path / "whole", **options)
    rng = np.random.default_rng(films)
    stops = 0
    for _ in range(200):
        try:
            with stopped_after(int(rng.integers(5, 28))):
                track_to_folder(film, out=tmp_path / "out", resume=True, **options)
            break
        except KeyboardInterrupt:
            stops += 1
            assert not (tmp_path / "out" / "angle.csv").exists()
    assert stops >= films
    for name in OUTPUTS:
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
