"""``track.json``: the precision that the film allowed, the precision reached, and how to film better."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.optics.hanging import USUAL_PX
from torsight.core.series import known_median
from torsight.core.tracks import MarkerTracks, StickAngles, mean_sigma
from torsight.core.units import DEG, Floats
from torsight.core.words.wording import RESOLUTION_DEG, counted
from tracker.angle.plane import Orientation
from tracker.frames.timing import timing
from tracker.quality.events import event, events_of_right, find_events
from tracker.quality.gap_pictures import Pictures
from tracker.quality.gaps import Causes, find_causes, flicker_advice, gap_advice, jump_advice, lone_marker_advice
from tracker.quality.light import FELT
from tracker.quality.track_warnings import exchanged
from tracker.rows import CODE, STATES
from tracker.track import TrackResult

_LOSSLESS: Final = ("ffv1", "rawvideo", "huffyuv", "utvideo", "none", "png", "qtrle", "lagarith", "v210")


def account(
    result: TrackResult,
    orientation: Orientation,
    *,
    doubts: Sequence[str],
    minor: Sequence[str] = (),
    remarks: Sequence[str] = (),
    pictures: Pictures | None = None,
    right: TrackResult | None = None,
) -> dict[str, Any]:
    """Return the content of ``track.json``.

    ``doubts`` are those of :func:`tracker.quality.track_warnings.doubts`, ``minor`` ones explain no frame without an
    angle, ``remarks`` are those on the camera from before the tracking; ``pictures`` returns frames by number, to
    examine some of those without an angle; ``right`` is the right film of a stereo pair.
    """
    angles, rows = orientation.angles, result.rows
    noise = orientation.report.get("noise", {})
    source = result.report["source"]
    times = timing(angles.time_s, tick_s=source.get("tick_s", 0.0))
    # For a film that plays at another rate than it was captured at, the bit rate is per second of playing time.
    own = source["kind"] == "film" and "tick_s" in source
    states = gap_states(rows, angles)
    causes = find_causes(result, angles, states, pictures=pictures)
    wrong = {"exchanged": True} if exchanged(result)[1] else {}
    content: dict[str, Any] = {
        **result.report,
        "markers": {**result.report["markers"], **wrong},
        "source": {**source, "fps": times.rate_fps} if own else source,
        "frames": frame_account(states, angles, causes),
        "timing": times.to_json(),
        **{name: value for name, value in orientation.report.items() if name != "noise"},
        "noise": noise_account(rows, orientation.with_errors(result.tracks), angles, noise),
        "compression": compression_account(result.report["source"], noise),
    }
    events = [event(angles, angles.frame, "camera", text) for text in remarks] + find_events(
        rows, angles, result.damage
    )
    if right is not None:
        content["right_film"] = {
            **right.report,
            "frames": len(right.rows),
            "error_over_white_noise": noise.get("error_over_white_noise_right"),
        }
        events = sorted(events + events_of_right(right, angles), key=lambda one: one["frame"])
    markers = result.report["markers"]
    # Doubts about the angles come before advice on how to improve them.
    content["advice"] = list(doubts)
    told = gap_advice(content["frames"], causes)
    content["advice"] += advice(
        content,
        length_px=markers["stick_length_px"],
        radius_px=markers["radius_px"] if markers["kind"] == "dot" else None,
        events=events,
        gaps=told
        + jump_advice(told, causes)
        + lone_marker_advice(result, angles, pictures=pictures)
        + flicker_advice(causes)
        + list(minor),
    )
    content["advice"] += orientation.report.get("scale", {}).get("complaints", [])
    content["events"] = events
    return content


def gap_states(rows: NDArray[np.void], angles: StickAngles) -> list[str]:
    """Return the reason, of ``STATES`` or ``impossible``, for every frame without an angle.

    It is the commonest state of the moving stick's missing markers, or else of the base's: of two that are as common
    the one that names what covers them, the other stick. It is ``impossible`` where all markers are seen, but were
    rejected later.
    """
    found: list[str] = []
    for index in np.flatnonzero(~angles.valid):
        states = rows["state"][index]
        moving = states[2:] if (states[2:] != CODE["seen"]).any() else states[:2]
        away = moving[moving != CODE["seen"]]
        count = Counter(away.tolist())
        most = max(count, key=lambda state: (count[state], state == CODE["shadowed"], -state), default=None)
        found.append("impossible" if most is None else STATES[most])
    return found


def frame_account(states: Sequence[str], angles: StickAngles, causes: Causes) -> dict[str, Any]:
    """Return the numbers of frames with and without an angle, the latter by the markers' states and by cause."""
    reasons = Counter(states)
    return {
        "total": len(angles),
        "with_angle": int(angles.valid.sum()),
        "without_angle": int((~angles.valid).sum()),
        "why": dict(reasons.most_common()),
        "causes": causes.count,
        "turn_uncertain": int((~angles.branch_certain & angles.valid).sum()),
    }


def noise_account(
    rows: NDArray[np.void], tracks: MarkerTracks, angles: StickAngles, noise: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the picture's noise, the lower bound of sigma by that noise, and the sigma that was reached."""
    seen = rows["state"] == CODE["seen"]
    covariance: Floats = rows["covariance_px2"]
    white = np.sqrt(0.5 * (covariance[..., 0] + covariance[..., 2]))
    reached = mean_sigma(tracks.covariance_px2)
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
    """Return the film's compression and its effect on the positions."""
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
    radius_px: float | None,
    events: list[dict[str, Any]],
    gaps: Sequence[str] = (),
) -> list[str]:
    """Return advice for the next film, the most important first.

    ``gaps`` is the advice on frames without an angle; ``radius_px`` is None where not all markers are dots.
    """
    words = list(gaps)
    compression, noise = account["compression"], account["noise"]
    ratio = compression["error_over_white_noise"]
    kinds = {one["kind"] for one in events}
    # A camera that moves changes the sticks' lengths, too, by which errors are measured.
    if ratio is not None and ratio > FELT and not compression["lossless"] and "bump" not in kinds:
        words.append(
            f"Compression ({compression['codec']}) makes positions {ratio:.1f} times worse than the picture's noise "
            "would: film with a higher bit rate (H.264 CRF 12 or less), Motion JPEG at high quality, or lossless "
            "FFV1."
        )
    bound_px, angle_deg = noise["marker_sigma_px"]["bound"], noise["angle_sigma_deg"]["median"]
    # The noise of the pictures displaces the dots by more than the usual errors of a codec.
    if radius_px is not None and bound_px is not None and bound_px > USUAL_PX:
        words.append(
            f"The dots are small or faint for the picture's noise (radius {radius_px:.1f} px, "
            f"{noise['marker_contrast_grey']:.0f} grey levels), which alone displaces them by {bound_px:.2f} px: "
            "darker dots or more light help directly, and the error falls as the root of their radius grows."
        )
    if radius_px is not None and angle_deg is not None and angle_deg > RESOLUTION_DEG:
        words.append(
            f"The markers of a stick are only {length_px:.0f} px apart, and the angle is known to {angle_deg:.2f} "
            "degrees: its error falls as their distance grows, so come closer or put the dots further apart."
        )
    if "bump" in kinds:
        words.append("The camera was moved during the film: fix it, and do not touch the table.")
    if "light" in kinds and "flicker" not in account["frames"]["causes"]:
        words.append("The light was off for a while: use a steady lamp.")
    if repeated := account.get("repeated_pictures", 0):
        words.append(
            f"In {counted(repeated, 'frame')} the picture repeats the one before it, and the angle is interpolated: "
            "the film was converted to another frame rate, or the camera lacks light. Use the camera's own film, or "
            "more light."
        )
    return words


def _median(values: NDArray[Any]) -> float | None:
    found = known_median(values)
    return None if np.isnan(found) else found
