"""``track.json``: what the film allowed, what was reached, and how to film better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.tracks import MarkerTracks, StickAngles
from torsight.core.units import DEG
from tracker.events import events_of_right, find_events
from tracker.gaps import gap_advice
from tracker.plane import Orientation
from tracker.rows import CODE, STATES
from tracker.track import TrackResult

_LOSSLESS: Final = ("ffv1", "rawvideo", "huffyuv", "utvideo", "none", "png", "qtrle", "lagarith", "v210")
_COMPRESSED: Final = 1.5
"""Error over that of white noise from which compression is felt."""
_SMALL_PX: Final = 4.0
_SHORT_PX: Final = 60.0
_FAINT: Final = 40.0


def account(
    result: TrackResult,
    orientation: Orientation,
    *,
    doubts: Sequence[str],
    remarks: Sequence[str] = (),
    right: TrackResult | None = None,
) -> dict[str, Any]:
    """Return the content of ``track.json``.

    ``doubts`` are those of :func:`tracker.doubts.doubts`, ``remarks`` what was noticed before anything was tracked,
    ``right`` is the right film of a stereo pair.
    """
    angles, rows = orientation.angles, result.rows
    noise = orientation.report.get("noise", {})
    content: dict[str, Any] = {
        **result.report,
        "frames": frame_account(rows, angles),
        **{name: value for name, value in orientation.report.items() if name != "noise"},
        "noise": noise_account(rows, orientation.with_errors(result.tracks), angles, noise),
        "compression": compression_account(result.report["source"], noise),
    }
    events = [_remark(angles, text) for text in remarks] + find_events(rows, angles, result.damage)
    if right is not None:
        content["right_film"] = {
            **right.report,
            "frames": len(right.rows),
            "error_over_white_noise": noise.get("error_over_white_noise_right"),
        }
        events = sorted(events + events_of_right(right, angles), key=lambda event: event["frame"])
    markers = result.report["markers"]
    # What makes the angles doubtful comes before what would make them better.
    content["advice"] = list(doubts)
    content["advice"] += advice(
        content,
        length_px=markers["stick_length_px"],
        radius_px=markers["radius_px"],
        events=events,
        gaps=gap_advice(content["frames"], result, angles),
    )
    content["advice"] += orientation.report.get("scale", {}).get("complaints", [])
    content["events"] = events
    return content


def _remark(angles: StickAngles, text: str) -> dict[str, Any]:
    first_s, last_s = (float(angles.time_s[at]) if len(angles) else 0.0 for at in (0, -1))
    return {
        "time_s": first_s,
        "frame": 0,
        "kind": "camera",
        "text": text,
        "end_time_s": last_s,
        "end_frame": max(len(angles) - 1, 0),
    }


def frame_account(rows: NDArray[np.void], angles: StickAngles) -> dict[str, Any]:
    """Return how many frames have an angle, and why the others have none."""
    reasons: dict[str, int] = {}
    for index in np.flatnonzero(~angles.valid):
        states = rows["state"][index]
        moving = states[2:] if (states[2:] != CODE["seen"]).any() else states[:2]
        name = (
            STATES[int(np.bincount(moving[moving != CODE["seen"]], minlength=1).argmax())]
            if (moving != CODE["seen"]).any()
            else "impossible"
        )
        reasons[name] = reasons.get(name, 0) + 1
    return {
        "total": len(angles),
        "with_angle": int(angles.valid.sum()),
        "without_angle": int((~angles.valid).sum()),
        "why": dict(sorted(reasons.items(), key=lambda item: -item[1])),
        "turn_uncertain": int((~angles.branch_certain & angles.valid).sum()),
    }


def noise_account(
    rows: NDArray[np.void], tracks: MarkerTracks, angles: StickAngles, noise: Mapping[str, Any]
) -> dict[str, Any]:
    """Return noise, the bound that it sets, and the sigma that was reached."""
    seen = rows["state"] == CODE["seen"]
    white = np.sqrt(0.5 * (rows["covariance_px2"][..., 0] + rows["covariance_px2"][..., 2]))
    reached = np.sqrt(0.5 * np.trace(tracks.covariance_px2, axis1=2, axis2=3))
    sigma = angles.sigma_rad[angles.valid & angles.branch_certain] / DEG
    return {
        "picture_noise_grey": _median(rows["residual"][seen]),
        "marker_contrast_grey": _median(np.abs(rows["step"][seen])),
        "marker_sigma_px": {"bound": _median(white[seen]), "reached": _median(reached[seen])},
        "angle_sigma_deg": {
            "bound": noise.get("angle_bound_deg"),
            "median": _median(sigma),
            "p95": float(np.percentile(sigma, 95)) if len(sigma) else None,
        },
        "error_over_white_noise": noise.get("error_over_white_noise"),
    }


def compression_account(source: Mapping[str, Any], noise: Mapping[str, Any]) -> dict[str, Any]:
    """Return how the film is compressed and what that does to the positions."""
    codec = str(source.get("codec", "unknown"))
    lossless = codec in _LOSSLESS
    rate, fps = source.get("bit_rate_kbps"), source.get("fps")
    pixels = float(source["width_px"]) * float(source["height_px"])
    ratio = (noise.get("error_over_white_noise") or {}).get("moving")
    return {
        "codec": codec,
        "lossless": lossless,
        "bits_per_pixel": None if not rate or not fps else 1000.0 * rate / fps / pixels,
        "error_over_white_noise": ratio,
    }


def advice(
    account: Mapping[str, Any],
    *,
    length_px: float,
    radius_px: float,
    events: list[dict[str, Any]],
    gaps: Sequence[str] = (),
) -> list[str]:
    """Return what would make the next film better, the most important first; ``gaps`` is of frames without an angle."""
    words: list[str] = []
    compression, noise = account["compression"], account["noise"]
    ratio = compression["error_over_white_noise"]
    if ratio is not None and ratio > _COMPRESSED and not compression["lossless"]:
        words.append(
            f"Compression ({compression['codec']}) makes positions {ratio:.1f} times worse than the picture's noise "
            "would: film with a higher bit rate (H.264 CRF 12 or less), Motion JPEG at high quality, or lossless FFV1."
        )
    words += gaps
    if radius_px < _SMALL_PX:
        words.append(f"The dots are small (radius {radius_px:.1f} px): dots of 6 px and more halve the error.")
    if length_px < _SHORT_PX:
        words.append(
            f"The markers of a stick are only {length_px:.0f} px apart: the angle's error falls as their distance "
            "grows, so come closer or put the dots further apart."
        )
    contrast = noise["marker_contrast_grey"]
    if contrast is not None and contrast < _FAINT:
        words.append(f"The dots are faint ({contrast:.0f} grey levels): darker dots or more light help directly.")
    kinds = {event["kind"] for event in events}
    if "bump" in kinds:
        words.append("The camera was moved during the film: fix it, and do not touch the table.")
    if "light" in kinds:
        words.append("The light was off for a while: use a steady lamp.")
    if "turn uncertain" in kinds:
        words.append("A gap was so long that a whole turn could be missing: keep at least one marker in sight.")
    return words


def _median(values: NDArray[Any]) -> float | None:
    known = np.asarray(values, dtype=np.float64)
    known = known[np.isfinite(known)]
    return float(np.median(known)) if len(known) else None
