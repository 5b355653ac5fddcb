"""Hidden effects outside the contract's list: mechanisms from the literature or from rigs, each with its law.

The contract's twelve effects, and the list of all, are in :mod:`torsight.synthetic.effects.hidden`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, make_dataclass
from typing import Any, Final

from torsight.core.units import DEG
from torsight.synthetic.keys import constants_of, key


@dataclass(frozen=True, slots=True)
class HiddenEffect:
    """One effect that a rig has and its ``actuator.toml`` does not declare; its keys are the scene file's."""

    def constants(self) -> dict[str, float]:
        """Return the integrator's constants that the keys set, SI; empty if the effect acts on clock or reading."""
        return constants_of(self)


def effect(meaning: str, **keys: Any) -> type[HiddenEffect]:
    """Return the class of an effect whose keys (:func:`~torsight.synthetic.keys.key`) only set constants."""
    made = [(name, type(declared.default), declared) for name, declared in keys.items()]
    return make_dataclass(
        "Effect", made, bases=(HiddenEffect,), namespace={"__doc__": meaning}, frozen=True, slots=True
    )


@dataclass(frozen=True, slots=True)
class Backlash(HiddenEffect):
    """Play between the disk and the stick."""

    gap_deg: float = key(3.0, "width of the play", lower=0.0, upper=90.0)


@dataclass(frozen=True, slots=True)
class EndStop(HiddenEffect):
    """A stop, soft or hard, that pushes back beyond an angle."""

    angle_deg: float = key(215.0, "where it begins", lower=0.0, upper=3000.0)
    stiffness_mnm_per_rad: float = key(3.0, "its stiffness", lower=0.0, upper=1e4, constant="stop_stiffness")
    side: str = key("both", "where it stands", choices=("both", "positive", "negative"))

    def constants(self) -> dict[str, float]:
        """Return the constants that it sets."""
        low, high = self.side != "positive", self.side != "negative"
        return {
            **HiddenEffect.constants(self),
            "stop_low": -self.angle_deg * DEG if low else -1e9,
            "stop_high": self.angle_deg * DEG if high else 1e9,
        }


@dataclass(frozen=True, slots=True)
class UnlikeSprings(HiddenEffect):
    """Spring B has values of its own: it transforms at other temperatures and is stiffer or softer."""

    a_shift_c: float = key(1.0, "by how much B's A_s and A_f are higher than A's", lower=-30.0, upper=30.0)
    m_shift_c: float = key(1.0, "by how much B's M_s and M_f are higher", lower=-30.0, upper=30.0)
    modulus_scale: float = key(1.0, "B's moduli as a multiple of A's", lower=0.2, upper=5.0)


@dataclass(frozen=True, slots=True)
class ReadingDrift(HiddenEffect):
    """The camera's mount or the stick's glue gives way from the film's start on."""

    rate_deg_h: float = key(4.0, "at the film's start", lower=-1e3, upper=1e3)
    settles_h: float = key(1e6, "time constant with which it comes to rest", lower=0.01, upper=1e6)


@dataclass(frozen=True, slots=True)
class RoomDrift(HiddenEffect):
    """The room warms up or oscillates, and the sensors' readings change with it."""

    rate_c_h: float = key(1.0, "drift of the readings", lower=-100.0, upper=100.0)
    swing_c: float = key(0.0, "half of a swing of the readings beside it", lower=-20.0, upper=20.0)
    period_h: float = key(0.7, "period of the swing", lower=0.01, upper=100.0)


MECHANISMS: Final[Mapping[str, type[HiddenEffect]]] = {
    "creep": effect(
        "The wound cold spring relaxes with the logarithm of time since the other one was switched on.",
        relaxation=key(0.03, "share of the torque lost per decade of time", lower=0.0, upper=0.5, constant="creep"),
        onset_s=key(10.0, "time at which it starts to show", lower=1e-3, upper=1e6, constant="creep_onset"),
    ),
    "unlike_lags": effect(
        "Either sensor follows its wire by its own time constant.",
        lag_a_s=key(3.0, "time constant of A's sensor", lower=0.0, upper=600.0, constant="lag_s"),
        lag_b_s=key(6.0, "time constant of B's sensor", lower=0.0, upper=600.0, constant="lag_b_s"),
    ),
    "torque_bias": effect(
        "A constant stray torque: lead wires.",
        bias_mnm=key(0.15, "torque towards positive angles", lower=-20.0, upper=20.0, constant="bias"),
    ),
    "gravity": effect(
        "An unbalanced disk: a torque that goes with the sine of the angle and does not change with direction.",
        amplitude_mnm=key(0.15, "largest torque", lower=0.0, upper=20.0, constant="gravity"),
        phase_rad=key(0.0, "angle at which it vanishes, negative", lower=-10.0, upper=10.0, constant="gravity_phase"),
    ),
    "grease_temperature": effect(
        "The grease thins as the body warms up: friction falls exponentially.",
        per_k=key(0.05, "relative fall per kelvin of the body above the room", lower=0.0, upper=1.0, constant="grease"),
    ),
    "backlash": Backlash,
    "static_friction": effect(
        "Friction at rest is above sliding friction and grows with the time at rest: stick and slip.",
        excess=key(0.3, "relative excess after a long rest", lower=0.0, upper=5.0, constant="static_excess"),
        ageing_s=key(60.0, "time constant of its growth", lower=1e-3, upper=1e6, constant="static_ageing"),
    ),
    "direction_friction": effect(
        "Friction differs by direction.",
        asymmetry=key(0.2, "relative excess in the positive direction", lower=-0.95, upper=0.95, constant="asymmetry"),
    ),
    "r_phase": effect(
        "A small, reversible early step of the spring's torque.",
        step_deg=key(25.0, "recoverable angle of the step", lower=0.0, upper=360.0, constant="r_step"),
        start_c=key(26.0, "temperature at which it begins", lower=-100.0, upper=200.0, constant="r_start"),
        width_c=key(12.0, "width of the step", lower=0.1, upper=200.0, constant="r_width"),
    ),
    "thermistor_curve": effect(
        "An error of the sensor's curve that bulges between 20 and 100 °C.",
        bulge_c=key(1.0, "largest error, at 60 °C", lower=-20.0, upper=20.0, constant="bulge_c"),
    ),
    "end_stop": EndStop,
    "imbalance": effect(
        "Spring B is stronger than spring A throughout.",
        excess=key(0.05, "relative excess of B's torque", lower=-0.9, upper=5.0, constant="imbalance"),
    ),
    "unlike_springs": UnlikeSprings,
    "local_torque": effect(
        "A torque at one place of the turn, the same in both directions.",
        height_mnm=key(0.3, "largest torque; of a magnet, towards it", lower=-20.0, upper=20.0, constant="local"),
        angle_deg=key(40.0, "the place", lower=-1e4, upper=1e4, constant="local_angle"),
        width_deg=key(25.0, "half of its width at half height, about", lower=1.0, upper=90.0, constant="local_width"),
        form=key("bump", "law; 'magnet' pulls from either side", choices=("bump", "magnet"), constant="local_form"),
    ),
    "reading_drift": ReadingDrift,
    "room_drift": RoomDrift,
    "latent_heat": effect(
        "The core of a wire that transforms is cooler or warmer than its surface, where the sensor is.",
        latent_c_s=key(80.0, "difference per rate of the martensite fraction", lower=0.0, upper=1e4, constant="latent"),
    ),
    "minor_loops": effect(
        "A transformation after an incomplete one begins only on the complete loop instead of immediately.",
        memory=key(0.7, "0: begins immediately; 1: on the complete loop", lower=0.0, upper=1.0, constant="loop_memory"),
    ),
    "stress_influence": effect(
        "Stress moves the transformations by another amount than declared.",
        heating_scale=key(0.85, "true over declared C_A", lower=0.1, upper=10.0, constant="c_a_scale"),
        cooling_scale=key(1.15, "true over declared C_M", lower=0.1, upper=10.0, constant="c_m_scale"),
    ),
    "transformation_drift": effect(
        "A spring's transformation temperatures move with each of its cycles.",
        heating_c=key(-0.3, "move of A_s and A_f per cycle", lower=-10.0, upper=10.0, constant="drift_heating"),
        cooling_c=key(-0.5, "move of M_s and M_f per cycle", lower=-10.0, upper=10.0, constant="drift_cooling"),
    ),
    "kinetics_shape": effect(
        "A small smooth error of the phase law: the transformation runs ahead or behind within its window.",
        bend=key(0.1, "shift of the progress at mid-window, as a share of it", lower=-0.9, upper=0.9, constant="bend"),
        tanaka=key(0.0, "share of the exponential law mixed in", lower=0.0, upper=1.0, constant="tanaka"),
    ),
}
"""Effects by id."""
