"""Compiles what the tests run, before pytest's workers would each do it for themselves; seconds where that is done.

Usage: python tests/compile_ahead.py (``make test`` runs it beside the other checks)
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))


def follow_dots() -> None:
    """Compile drawing and following of dots: a film of half a second."""
    from torsight.synthetic import render_scene, scene_from
    from tracker.frames.source import open_source
    from tracker.track import track_film

    motion = {"kind": "sweep", "sweep_deg": 40.0, "period_s": 4.0, "duration_s": 0.5}
    camera = {"width_px": 320, "height_px": 240, "focal_px": 800.0}
    scene = scene_from({"motion": motion, "film": {"fps": 20.0, "codec": "ffv1"}, "camera": camera})
    with tempfile.TemporaryDirectory() as folder:
        render_scene(scene, out=folder)
        track_film(open_source(Path(folder) / "film.mkv"))


def follow_patches() -> None:
    """Compile the following of textures and tags, ten frames, and the drawing of the tests' films."""
    from tests.tracker.films import Rig
    from tests.tracker.flat_films import FlatFilm, Sprite, texture_picture
    from tracker.detect.marker_file import read_markers
    from tracker.frames.source import open_source
    from tracker.track import track_film

    sticks = [[Sprite(texture_picture(np.random.default_rng(seed), 90, 400), 65.0, 130.0)] for seed in (1, 2)]
    film = FlatFilm(*sticks, angle_deg=lambda time_s: 60.0 + 100.0 * time_s, frames=10)
    inner_outer = {
        name: [film.on_stick(stick, 60.0, along).tolist() for along in (35.0, 100.0)]
        for stick, name in enumerate(("base", "moving"))
    }
    with tempfile.TemporaryDirectory() as folder:
        path = film.write(Path(folder) / "film.mkv")
        track_film(open_source(path), markers=read_markers({"kind": "texture", **inner_outer}))
    next(Rig(lambda time_s: 0.0 * time_s).pictures())


def integrate_and_model() -> None:
    """Compile the synthetic rig, the conditioning of its log, and the model that is fitted to it."""
    from torsight.actuator import ActuatorModel, fit_model, reference_spec
    from torsight.synthetic import make_record

    record = make_record({"protocol": {"time_factor": 0.05}})
    model = ActuatorModel(replace(reference_spec(), uncertainty={"tau_c_mnm": 0.3}), ["backlash"])
    fit_model(model, model.prepare(record.table))
    import torsight.discovery.own.compiled.stepper  # noqa: F401 - its machine code is made where it is imported


def main() -> None:
    """Compile on two cores, the longest first."""
    from torsight.core.lazy import collect_seldom

    work: tuple[Callable[[], None], ...] = (follow_dots, integrate_and_model, follow_patches)
    # The compiler makes millions of small objects and drops few.
    with ProcessPoolExecutor(2, get_context("spawn"), initializer=collect_seldom) as pool:
        for done in [pool.submit(one) for one in work]:
            done.result()


if __name__ == "__main__":
    main()
