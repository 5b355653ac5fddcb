"""Error caused by codec, marker size, light, exposure and distance, one at a time, on rendered films.

A stick turns in front of a camera that looks straight along the axis, so that the angle needs no correction and the
remaining error is that of the markers. The first row is the reference; every other row changes the property that it
names.

    python benchmarks/calibration/filming.py
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from films import tracks_of
from ways import error_deg

from torsight.core.errors import NoResultError
from torsight.core.files.storage import read_table
from torsight.synthetic.filming import optics
from torsight.synthetic.scene import scene_from
from torsight.synthetic.scene_files import render_scene

REFERENCE: dict[str, dict[str, Any]] = {
    "motion": {"kind": "turn", "start_deg": 40.0, "rate_deg_s": 12.0, "duration_s": 10.0},
    "film": {"fps": 20.0, "codec": "h264", "crf": 12},
    "camera": {"focal_px": 1100.0, "distance_mm": 250.0},
}
CHANGES: dict[str, dict[str, dict[str, Any]]] = {
    "reference: H.264 CRF 12, dot radius 6.6 px, sharp, well lit": {},
    "lossless (FFV1)": {"film": {"codec": "ffv1"}},
    "MJPEG": {"film": {"codec": "mjpeg"}},
    "H.264 CRF 4": {"film": {"crf": 4}},
    "H.264 CRF 18": {"film": {"crf": 18}},
    "H.264 CRF 23": {"film": {"crf": 23}},
    "H.264 CRF 28": {"film": {"crf": 28}},
    "dot radius 1.8 px": {"sticks": {"dot_mm": 0.4}},
    "dot radius 3.3 px": {"sticks": {"dot_mm": 0.75}},
    "dot radius 10 px": {"sticks": {"dot_mm": 2.2}},
    "markers half as far apart": {"sticks": {"inner_mm": 20.0}},
    "a quarter of the light (noise 4 ×)": {"light": {"read_noise": 6.0, "shot_noise": 0.16}},
    "grey dots (contrast 40 of 165)": {"sticks": {"dot_level": 155.0}},
    "out of focus (blur 2.5 px)": {"light": {"blur_px": 2.5}},
    "fast: 120 °/s, shutter 30 %": {"motion": {"rate_deg_s": 120.0}},
    "fast: 120 °/s, shutter 100 %": {"motion": {"rate_deg_s": 120.0}, "film": {"exposure": 1.0}},
    "twice as far": {"camera": {"distance_mm": 500.0}},
    "mains flicker of 20 %": {"light": {"flicker": 0.2}},
    "camera shakes by 1 px": {"camera": {"shake_px": 1.0}},
}


def errors_deg(change: dict[str, dict[str, Any]]) -> np.ndarray:
    """Return the angle's error in every frame, NaN where it is not known."""
    content: dict[str, Any] = {"seed": 3}
    for section in sorted({*REFERENCE, *change}):
        content[section] = REFERENCE.get(section, {}) | change.get(section, {})
    film = scene_from(content)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        render_scene(film, out=folder)
        truth = read_table(folder / "truth.csv", required=("angle_deg",))["angle_deg"].to_numpy()
        tracks = tracks_of(next(folder.glob("film.*")), optics.views(film)[0], film)
    sticks = tracks.position_px[:, 1::2] - tracks.position_px[:, ::2]
    direction = np.arctan2(-sticks[..., 1], sticks[..., 0])
    return error_deg(direction[:, 1] - direction[:, 0], np.radians(truth))


def main() -> None:
    """Print the table: rms error of the angle, and over the reference's."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    print("| film | frames with an angle | rms error, ° | over the reference |")
    print("| --- | --- | --- | --- |")
    reference = np.nan
    for name, change in CHANGES.items():
        try:
            error = errors_deg(change)
        except NoResultError as error:
            print(f"| {name} | none: {error.what} | | |")
            continue
        known = error[np.isfinite(error)]
        if not len(known):
            print(f"| {name} | 0 % | | |")
            continue
        rms = float(np.sqrt(np.mean(known**2)))
        reference = rms if not change else reference
        seen = 100.0 * len(known) / len(error)
        print(f"| {name} | {seen:.0f} % | {rms:.4f} | {rms / reference:.1f} |")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
