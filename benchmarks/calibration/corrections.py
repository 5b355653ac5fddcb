"""Benefit of each correction of the camera: the angle's error over tilts, lenses and distances.

A rig of known geometry is projected by a camera of known lens; the markers get 0.03 px of noise. The camera that
corrects is not the true one but one calibrated from 14 views of a board with 0.1 px of noise, as a user would have it;
the pose comes from a board on the disk, seen once.

    python benchmarks/calibration/corrections.py
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from ways import angles_by_way, error_deg

from calibration.axis import pose_on_disk
from calibration.boards.board_file import Board
from calibration.cameras.lens import calibrate_lens
from calibration.cameras.stereo_pair import calibrate_pair
from calibration.views.detect import View
from torsight.core.optics.camera import Camera, Intrinsics, Pose, RightCamera
from torsight.core.optics.geometry import project, rotation_matrix, rotation_vector

TILTS_DEG = (0, 5, 10, 15, 20, 30)
RADIAL = (0.0, -0.05, -0.15, -0.30)
DISTANCES_MM = (150, 300, 600)
SIGMA_PX = 0.03
BOARD_SIGMA_PX = 0.1
SIZE_PX = (640, 480)
FOCAL_PX = 1200.0
BOARD = Board("chessboard", columns=9, rows=6, square_mm=8.0)
RESTING = np.array([[-10.0, 3.0, 0.0], [-27.0, 7.0, 0.0]])
RADII_MM = (9.0, 26.0)
MOVING_Z_MM = 6.0
Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Rig:
    """A tilted, distorting camera above a rig, and what its user knows of it after calibration."""

    tilt_deg: float
    k1: float
    distance_mm: float
    true: Camera
    known: Camera


def lens(k1: float) -> Intrinsics:
    """Return the true lens: off-centre, with a little decentring."""
    matrix = np.array([[FOCAL_PX, 0, 330.0], [0, FOCAL_PX * 1.002, 232.0], [0, 0, 1.0]])
    return Intrinsics(SIZE_PX, matrix, np.array([k1, -0.2 * k1, 0.0004, -0.0003, 0.0]))


def pose_at(tilt_deg: float, distance_mm: float, azimuth_deg: float = 35.0) -> Pose:
    """Return the true pose: the axis meets the picture a little off its middle."""
    tilt, azimuth = np.radians([tilt_deg, azimuth_deg])
    facing = rotation_matrix(np.array([np.pi, 0.0, 0.0]))
    lean = rotation_matrix(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
    place = distance_mm * np.array([0.015, -0.01, 1.0])
    return Pose(rotation_vector(lean @ facing), place, 0.0, MOVING_Z_MM)


def board_views(intrinsics: Intrinsics, poses: list[np.ndarray], rng: np.random.Generator) -> list[View]:
    """Return views of the board with noisy corners."""
    views = []
    for index, pose in enumerate(poses):
        corners = project(BOARD.points_mm(), intrinsics, rvec=pose[:3], tvec_mm=pose[3:])
        corners = corners + rng.normal(0, BOARD_SIGMA_PX, corners.shape)
        numbers = np.arange(len(corners))
        views.append(View(f"view{index}", index, numbers, BOARD.points_mm(), corners, corners, 30.0))
    return views


def board_poses(rng: np.random.Generator, distance_mm: float) -> list[np.ndarray]:
    """Return 14 poses of the board, tilted to all sides, spread over the picture."""
    poses = []
    for side in np.linspace(0, 2 * np.pi, 14, endpoint=False):
        tilt = np.radians(rng.uniform(15, 40)) * np.array([np.cos(3 * side), np.sin(3 * side), 0.0])
        depth = rng.uniform(0.8, 1.2) * distance_mm
        poses.append(
            np.concatenate((tilt, depth * np.array([0.13, 0.1, 0]) * [np.cos(side), np.sin(side), 0] + depth * Z))
        )
    return poses


def calibrated(true: Camera, rng: np.random.Generator) -> Camera:
    """Return the camera as its user finds it: lenses and pair from boards, the pose from a board on the disk."""
    poses = board_poses(rng, 0.9 * FOCAL_PX / 4.5)
    left = calibrate_lens(board_views(true.intrinsics, poses, rng), SIZE_PX)
    on_disk = rotation_matrix(true.pose.rvec) @ rotation_matrix(np.array([np.pi, 0.0, 0.0]))
    view = board_views(true.intrinsics, [np.concatenate((rotation_vector(on_disk), true.pose.tvec_mm))], rng)
    disk = pose_on_disk(view, left.fit.intrinsics, BOARD, moving_z_mm=MOVING_Z_MM)
    turned = [in_right(pose, true.right) for pose in poses]
    right = calibrate_lens(board_views(true.right.intrinsics, turned, rng), SIZE_PX)
    return Camera(left.fit.intrinsics, pose=disk.pose, right=calibrate_pair(left, right).right)


def in_right(pose: np.ndarray, right: RightCamera) -> np.ndarray:
    """Return a pose of the left camera for the right one."""
    rotation = rotation_matrix(right.rvec)
    return np.concatenate((rotation_vector(rotation @ rotation_matrix(pose[:3])), rotation @ pose[3:] + right.tvec_mm))


def rigs(rng: np.random.Generator) -> Iterator[Rig]:
    """Give every combination of tilt, lens and distance."""
    for distance_mm, k1, tilt_deg in itertools.product(DISTANCES_MM, RADIAL, TILTS_DEG):
        convergence = 0.25
        place = rotation_matrix(np.array([0.0, convergence, 0.0]))
        shift = distance_mm * (Z - place @ Z)
        right = RightCamera(lens(k1), np.array([0.0, convergence, 0.0]), shift)
        true = Camera(lens(k1), pose=pose_at(tilt_deg, distance_mm), right=right)
        yield Rig(tilt_deg, k1, distance_mm, true, calibrated(true, rng))


def markers(turn_rad: np.ndarray) -> np.ndarray:
    """Return the four markers (n, 4, 3) in the world."""
    points = np.empty((len(turn_rad), 4, 3))
    points[:, :2] = RESTING
    wave = np.stack((np.cos(turn_rad), np.sin(turn_rad)), axis=1)
    for place, radius in enumerate(RADII_MM):
        points[:, 2 + place, :2] = radius * wave
    points[:, 2:, 2] = MOVING_Z_MM
    return points


def angles(rig: Rig, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return the error of the angle in degrees for each way to correct."""
    turn = np.radians(np.linspace(0, 400, 600))
    pose, right = rig.true.pose, rig.true.right
    seen = markers(turn) @ rotation_matrix(pose.rvec).T + pose.tvec_mm
    noise = rng.normal(0, SIGMA_PX, (2, *seen.shape[:2], 2))
    left_px = project(seen, rig.true.intrinsics) + noise[0]
    right_px = project(seen, right.intrinsics, rvec=right.rvec, tvec_mm=right.tvec_mm) + noise[1]
    covariance = np.broadcast_to(np.eye(2) * SIGMA_PX**2, (*left_px.shape, 2))
    measured = angles_by_way((left_px, covariance), (right_px, covariance), rig.known)
    return {way: error_deg(angle, turn) for way, angle in measured.items()}


def rows(seed: int) -> Iterator[tuple[Rig, dict[str, np.ndarray]]]:
    """Give the errors for every rig."""
    rng = np.random.default_rng(seed)
    for rig in rigs(rng):
        yield rig, angles(rig, rng)


def main() -> None:
    """Print the table: rms error of the angle in degrees."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    seed = parser.parse_args().seed
    cv2.setNumThreads(1)
    header = False
    for rig, errors in rows(seed):
        if not header:
            print("| distance, mm | k1 | tilt, ° | " + " | ".join(errors) + " |")
            print("| --- " * (3 + len(errors)) + "|")
            header = True
        cells = " | ".join(f"{np.sqrt(np.mean(error**2)):.3f}" for error in errors.values())
        print(f"| {rig.distance_mm} | {rig.k1:g} | {rig.tilt_deg} | {cells} |")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
