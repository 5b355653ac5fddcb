"""Films' angles and logs of the synthetic rig, whose clock is known: another integrator, and effects hidden in it.

Every seed draws its own spring values, programme (two to four cycles, rates, peaks, an incomplete cycle in most), pace
(the paper's or a tenth of its time), frame rate, noise and clock.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from made_up_pairs import Pair

from torsight.core.units import DEG
from torsight.synthetic.experiment import log_columns, play_scene
from torsight.synthetic.scene import scene_from

Draw = Callable[[np.random.Generator, float], dict[str, Any]]

HIDDEN: Final[Mapping[str, Draw]] = {
    "plain": lambda _g, _pace: {},
    "sensor_lag": lambda g, pace: {
        "lag_s": pace * g.uniform(2, 15),
        "form": str(g.choice(["first_order", "two_stage"])),
    },
    "sensor_gain": lambda g, _pace: {"gain": g.uniform(0.9, 0.97)},
    "heat_crosstalk": lambda g, _pace: {"conductance_w_per_k": g.uniform(0.008, 0.03)},
    "nonuniform_temperature": lambda g, _pace: {"cooler_c": g.uniform(3, 12), "share": g.uniform(0.1, 0.4)},
    "coil_friction": lambda g, _pace: {"rise_mnm": g.uniform(0.08, 0.4), "onset_deg": g.uniform(600, 700)},
    "viscous_friction": lambda g, pace: {"viscous_mnm_s_per_rad": pace * g.uniform(2, 20)},
    "position_friction": lambda g, _pace: {"amplitude": g.uniform(0.15, 0.5), "phase_rad": g.uniform(-3, 3)},
    "fatigue": lambda g, _pace: {"loss": g.uniform(0.006, 0.03)},
    "eccentricity": lambda g, _pace: {"amplitude_deg": g.uniform(0.6, 3.0), "phase_rad": g.uniform(-3, 3)},
    "stiffening": lambda g, _pace: {"rise_mnm": g.uniform(0.1, 0.6), "onset_deg": g.uniform(600, 700)},
    "marker_slip": lambda g, pace: {"time_s": pace * g.uniform(500, 2000), "step_deg": g.uniform(2, 8)},
    "creep": lambda g, _pace: {"relaxation": g.uniform(0.02, 0.06)},
    "backlash": lambda g, _pace: {"gap_deg": g.uniform(2, 6)},
}
"""Effects by id, with sizes as they usually are; what has a time in it goes with the pace."""


def rig_pair(seed: int, effect: str, *, offset_s: float, drift_ppm: float) -> Pair:
    """Run the rig of a seed with one hidden effect and return what film and log show."""
    rng = np.random.default_rng([seed, 17])
    pace = float(rng.choice([0.1, 1.0]))
    hidden = HIDDEN[effect](rng, pace)
    scene = scene_from(
        {
            "seed": seed,
            "protocol": {"time_factor": pace, "rest_s": 40.0, "half_cycle": _programme(rng)},
            "effects": {effect: hidden} if hidden else {},
            "mechanics": {"substeps": 4},
            "sensor": {"sample_s": float(rng.choice([0.015, 0.05, 0.25])) if pace == 1.0 else 0.015},
            "log": {
                "offset_s": offset_s,
                "drift_ppm": drift_ppm,
                "lost": 0.2,
                "before_s": pace * rng.uniform(0.0, 100.0),
                "after_s": pace * rng.uniform(0.0, 100.0),
            },
        }
    )
    played = play_scene(scene)
    rig = played.rig
    if rig is None:
        msg = "a scene without a rig"
        raise RuntimeError(msg)
    fps = float(rng.choice([4.0, 15.0, 30.0])) if pace == 1.0 else float(rng.choice([15.0, 30.0, 60.0]))
    film_s = np.arange(0.0, played.duration_s, 1.0 / fps)
    noise_deg = float(np.exp(rng.uniform(np.log(0.01), np.log(0.15))))
    angle_deg = played.stick_angle(film_s) / DEG + noise_deg * rng.standard_normal(len(film_s))
    log = log_columns(played)
    switch = np.diff((rig.heat_a | rig.heat_b).astype(np.int8))
    step_s = float(rig.time_s[1] - rig.time_s[0])
    # A sample shows what holds until the next: the switch changes where the sample that shows it begins.
    on_s, off_s = ((np.flatnonzero(switch == sign) + 1) * step_s - played.before_s for sign in (1, -1))
    count = min(len(on_s), len(off_s))
    return Pair(
        film_s=film_s,
        angle_deg=angle_deg,
        log_s=log["time_s"],
        temp_a_c=log["temp_a_c"],
        temp_b_c=log["temp_b_c"],
        heat_a=log["heat_a"],
        heat_b=log["heat_b"],
        offset_s=offset_s,
        drift_ppm=drift_ppm,
        switch_true_s=np.stack([on_s[:count], off_s[:count]], axis=1),
    )


def _programme(rng: np.random.Generator) -> list[dict[str, Any]]:
    cycles = int(rng.integers(2, 5))
    incomplete = int(rng.integers(cycles)) if rng.random() < 0.7 else -1
    return [
        {
            "spring": spring,
            "peak_c": float(rng.uniform(58.0, 63.0) if cycle == incomplete else rng.uniform(72.0, 86.0)),
            "ramp_s": (ramp_s := float(rng.uniform(250.0, 580.0))),
            "heat_s": ramp_s + float(rng.uniform(8.0, 45.0)),
            "cool_s": float(rng.uniform(260.0, 350.0)),
        }
        for cycle in range(cycles)
        for spring in "ab"
    ]
