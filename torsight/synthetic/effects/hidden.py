"""Hidden effects that a rig can have: the action of each in the rig, its parameters, and the laws that it can follow.

The first twelve have the ids of the public contract; their laws here are written for a moving rig, and most have a
second form that differs from that of the effect's file. Torques that grow past an onset are given by their value 100°
beyond it. Effects outside the contract's list are in :mod:`torsight.synthetic.effects.mechanisms`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from torsight.core.files.config import get_table
from torsight.core.files.storage import check_keys
from torsight.synthetic.effects.mechanisms import MECHANISMS, HiddenEffect, effect
from torsight.synthetic.keys import key, read_section

STIFFENING_FORMS: Final = ("cubic", "third_slope", "quadratic", "loading", "bend", "bend_alone")


@dataclass(frozen=True, slots=True)
class SensorLag(HiddenEffect):
    """The sensor follows the wire late: τ dT_m/dt = T − T_m, once or in two stages of τ/2."""

    lag_s: float = key(6.0, "time constant of the sensor", lower=0.0, upper=600.0, constant="lag_s")
    form: str = key("first_order", "law", choices=("first_order", "two_stage"))

    def constants(self) -> dict[str, float]:
        """Return the constants that it sets."""
        stages = 2 if self.form == "two_stage" else 1
        return {**HiddenEffect.constants(self), "lag_b_s": self.lag_s, "lag_stages": stages}


@dataclass(frozen=True, slots=True)
class ClockOffset(HiddenEffect):
    """A clock error that nobody corrected: the temperatures of a merged table are this late or early."""

    offset_s: float = key(1.0, "temperature time minus film time at the start", lower=-600.0, upper=600.0)
    drift_ppm: float = key(0.0, "drift between the clocks", lower=-1000.0, upper=1000.0)


@dataclass(frozen=True, slots=True)
class HeatCrosstalk(HiddenEffect):
    """More heat passes to the other spring, which starts to transform at its own temperature and stress."""

    conductance_w_per_k: float = key(
        0.012, "heat passing directly between the wires", lower=0.0, upper=1.0, constant="between_more"
    )
    share: float = key(
        1.0, "share of the other spring that gets warm", lower=0.0, upper=1.0, constant="crosstalk_share"
    )

    def constants(self) -> dict[str, float]:
        """Return the constants that it sets."""
        return {**HiddenEffect.constants(self), "crosstalk": 1}


@dataclass(frozen=True, slots=True)
class NonuniformTemperature(HiddenEffect):
    """Ends and contacts are cooler: two zones, or a profile along the wire."""

    cooler_c: float = key(8.0, "how much cooler the ends are than the middle", lower=0.0, upper=50.0)
    share: float = key(0.25, "share of the wire that is cool (two zones)", lower=0.0, upper=1.0)
    form: str = key("two_zone", "law", choices=("two_zone", "profile"), constant="zone_form")

    def constants(self) -> dict[str, float]:
        """Return the constants that it sets."""
        return {**HiddenEffect.constants(self), "zone_scale": 50.0 if self.form == "profile" else 5.0}


@dataclass(frozen=True, slots=True)
class Eccentricity(HiddenEffect):
    """Disk or markers off the axis: the stick's angle errs once per turn."""

    amplitude_deg: float = key(1.5, "size of the error", lower=0.0, upper=30.0)
    phase_rad: float = key(0.0, "phase of the error", lower=-10.0, upper=10.0)
    form: str = key("sine", "law; 'lever' is the exact angle of an offset lever", choices=("sine", "lever"))


@dataclass(frozen=True, slots=True)
class MarkerSlip(HiddenEffect):
    """The moving stick slips on its disk, at one moment of the film or within a few seconds."""

    time_s: float = key(300.0, "when, on the film's clock", lower=-1e7, upper=1e7)
    step_deg: float = key(4.0, "by how much", lower=-180.0, upper=180.0)
    lasts_s: float = key(0.0, "how long it takes", lower=0.0, upper=1e5)


HIDDEN: Final[Mapping[str, type[HiddenEffect]]] = {
    "sensor_lag": SensorLag,
    "sensor_gain": effect(
        "The sensor reads between wire and room; 'curved' loses contact as the wire gets hotter.",
        gain=key(
            0.95, "reading above room per excess of the wire at 60 K", lower=0.2, upper=2.0, constant="sensor_gain"
        ),
        form=key("linear", "law", choices=("linear", "curved"), constant="sensor_form"),
    ),
    "clock_offset": ClockOffset,
    "heat_crosstalk": HeatCrosstalk,
    "nonuniform_temperature": NonuniformTemperature,
    "coil_friction": effect(
        "Tight coils rub: friction that grows with the winding of either spring past an onset.",
        rise_mnm=key(0.3, "added friction 100° past the onset", lower=0.0, upper=20.0, constant="coil"),
        onset_deg=key(650.0, "winding at which the coils touch", lower=0.0, upper=3000.0, constant="coil_onset"),
        form=key("linear", "law", choices=("linear", "quadratic", "exponential"), constant="coil_form"),
    ),
    "viscous_friction": effect(
        "Grease: torque with the speed, or with its power 0.7.",
        viscous_mnm_s_per_rad=key(2.0, "torque at 1 rad/s", lower=0.0, upper=1000.0, constant="viscous"),
        form=key("linear", "law", choices=("linear", "power"), constant="viscous_form"),
    ),
    "position_friction": effect(
        "Friction that changes once per turn: a sine, or one flattened at its extremes.",
        amplitude=key(0.4, "relative change of the Coulomb torque", lower=-0.95, upper=0.95, constant="position"),
        phase_rad=key(0.0, "phase of the change", lower=-10.0, upper=10.0, constant="position_phase"),
        form=key("sine", "law", choices=("sine", "flattened"), constant="position_form"),
    ),
    "stiffening": effect(
        "The stress-induced martensite ends: a wound spring stiffens past an onset.",
        rise_mnm=key(0.4, "added torque 100° past the onset", lower=0.0, upper=20.0, constant="stiff"),
        onset_deg=key(650.0, "winding at which it starts", lower=0.0, upper=3000.0, constant="stiff_onset"),
        form=key(
            "cubic",
            "law; 'loading' is a third slope of the loading curve, which is unwound along the first, "
            "'bend' a cubic of it, 'bend_alone' one that the recoverable angle does not follow",
            choices=STIFFENING_FORMS,
            constant="stiff_form",
        ),
    ),
    "eccentricity": Eccentricity,
    "fatigue": effect(
        "The recoverable angle falls from cycle to cycle, without end or towards a limit.",
        loss=key(
            0.01,
            "share lost per cycle (geometric), or in the end (saturating)",
            lower=0.0,
            upper=0.9,
            constant="fatigue",
        ),
        cycles=key(3.0, "cycles to 63 % of the loss (saturating)", lower=0.1, upper=1e4, constant="fatigue_cycles"),
        form=key(
            "geometric",
            "law; 'plastic' saturates, and an angle is lost: that share of what a winding by 0.66 of both leaves",
            choices=("geometric", "saturating", "plastic"),
            constant="fatigue_form",
        ),
    ),
    "marker_slip": MarkerSlip,
    **MECHANISMS,
}
"""Effects by id; the first twelve are those of the public contract."""


def read_hidden(table: Mapping[str, Any], *, where: str) -> dict[str, HiddenEffect]:
    """Read the table [effects]: one sub-table per effect that the rig has.

    Raises ConfigError for an effect or a key that is not known (naming the nearest).
    """
    place = f"{where}, [effects]"
    check_keys(table, tuple(HIDDEN), where=place)
    return {
        name: read_section(HIDDEN[name], get_table(table, name, where=place), where=f"{where}, [effects.{name}]")
        for name in table
    }
