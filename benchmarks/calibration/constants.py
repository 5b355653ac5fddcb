"""Effect of halving and doubling each constant of a calibration, with known corners and camera.

Boards drawn by the tests' own generator (two sizes of picture, sharp and blurred, the board near and far) are found
with each constant changed in turn: share of the pictures in which the board is found, of those found as in a film, rms
error of the corners in the narrow and in the wide window. Then how many boards seem to go on beyond the corners that
are counted, of whole ones and of those that do. The last ones are of the fit: lenses from twelve views with exact
corners and noise of 0.1 px, of which one view is off by one pixel and one by three: error of the focal length over its
own sigma (rms), the sigma as a share of the focal length, views that are set aside.

    python benchmarks/calibration/constants.py
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "calibration")]

from made_up_views import (  # noqa: E402 - needs the path above
    CHESSBOARD,
    LENS,
    SIZE_PX,
    corners_px,
    exact_view,
    picture,
    poses,
    whole,
)

from benchmarks.half_and_twice import half_and_twice  # noqa: E402 - needs the path above
from calibration.cameras import lens  # noqa: E402 - needs the path above
from calibration.views import detect  # noqa: E402 - needs the path above
from torsight.core.optics.camera import Intrinsics  # noqa: E402 - needs the path above

WINDOWS = (
    "_DETECTION_SIDE_PX", "_QUICK_SIDE_PX", "_NARROW_SHARE", "_WIDE_SHARE", "_WIDEST_PX", "_WINDOW_PER_EDGE",
)  # fmt: skip
FITS = ("_WORSE_THAN_MEDIAN", "_NEVER_BAD_PX", "_MOST_GROUPS")


def pictures(seeds: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return pictures of the board, each with its true corners."""
    made = []
    for scale, blur_px in ((1, 0.6), (1, 1.5), (3, 0.8), (3, 4.0)):
        matrix = LENS.matrix * scale
        matrix[2, 2] = 1.0
        seen = Intrinsics((SIZE_PX[0] * scale, SIZE_PX[1] * scale), matrix, LENS.distortion)
        for distance_mm in ((120.0, 190.0), (280.0, 330.0)):
            for number, pose in enumerate(whole(poses(seeds, 7 + scale, distance_mm=distance_mm))):
                grey = picture(pose, lens=seen, blur_px=blur_px, noise=3.0, seed=number)
                made.append((grey, corners_px(pose, seen)))
    return made


def found(made: list[tuple[np.ndarray, np.ndarray]]) -> str:
    """Return how boards are found, and how exact their corners are."""
    seen, quick, narrow, wide = 0, 0, [], []
    for grey, truth in made:
        quick += detect.find_board(grey, CHESSBOARD, quick=True) is not None
        view = detect.find_board(grey, CHESSBOARD)
        if view is None:
            continue
        seen += 1
        narrow.append(np.mean((view.corners_px - truth[view.corner]) ** 2))
        wide.append(np.mean((view.wide_px - truth[view.corner]) ** 2))
    return (
        f"found {seen / len(made):4.0%} quick {quick / len(made):4.0%} narrow {np.sqrt(np.mean(narrow)):6.4f} px "
        f"wide {np.sqrt(np.mean(wide)):6.4f} px"
    )


def beyond(made: list[tuple[np.ndarray, np.ndarray]]) -> str:
    """Return which boards seem to go on: whole ones, and whole ones of which one row fewer is counted."""
    fewer = replace(CHESSBOARD, rows=CHESSBOARD.rows - 1)
    seen: dict[str, list[bool]] = {"whole": [], "larger": []}
    for grey, _ in made:
        if detect.find_board(grey, CHESSBOARD) is not None:
            seen["whole"].append(detect.goes_on(grey, CHESSBOARD))
            seen["larger"].append(detect.goes_on(grey, fewer))
    return f"goes on: {np.mean(seen['whole']):4.0%} of whole boards, {np.mean(seen['larger']):4.0%} of larger ones"


def fitted(seeds: int) -> str:
    """Return how well focal lengths are known where two views are bad."""
    pulls, sigmas, aside, good_aside = [], [], 0, 0
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        views = [exact_view(pose, n, sigma_px=0.1, rng=rng) for n, pose in enumerate(poses(12, seed))]
        for place, size_px in ((3, 1.0), (8, 3.0)):
            off = size_px * rng.standard_normal(views[place].corners_px.shape) / np.sqrt(2.0)
            views[place] = replace(
                views[place], corners_px=views[place].corners_px + off, wide_px=views[place].wide_px + off
            )
        result = lens.calibrate_lens(views, SIZE_PX)
        focal = result.fit.intrinsics.matrix[0, 0]
        pulls.append((focal - LENS.matrix[0, 0]) / result.sigma[0])
        sigmas.append(result.sigma[0] / focal)
        gone = {one.view for one in result.aside}
        aside += len(gone & {3, 8})
        good_aside += len(gone - {3, 8})
    return (
        f"pull {np.sqrt(np.mean(np.square(pulls))):5.2f} sigma {np.mean(sigmas):7.3%} bad views set aside "
        f"{aside / (2 * seeds):4.0%} good ones {good_aside / (10 * seeds):5.1%}"
    )


def main() -> None:
    """Print one row per constant and factor."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3, help="pictures of a kind; five times as many lenses")
    options = parser.parse_args()
    made = pictures(options.seeds)
    print(f"{len(made)} pictures; as it is: {found(made)}", flush=True)
    for name in WINDOWS:
        for factor in half_and_twice(name, detect):
            print(f"{name:20s} x{factor:<3g} {found(made)}", flush=True)
    print(f"{len(made)} pictures; as it is: {beyond(made)}", flush=True)
    print(f"{5 * options.seeds} lenses; as it is: {fitted(5 * options.seeds)}", flush=True)
    for name in FITS:
        for factor in half_and_twice(name, lens):
            print(f"{name:20s} x{factor:<3g} {fitted(5 * options.seeds)}", flush=True)


if __name__ == "__main__":
    main()
