"""Effects that the quasi-static model lacks: one module each, found by listing this folder.

A module ``effects/<id>.py`` declares ``EFFECT``, an :class:`Effect`. A new module needs no other change: models, fits,
discovery, the model file and the common test find it in this folder. The first arguments of a :class:`Parameter` are
its name, start, unit and both bounds.
"""

from __future__ import annotations

import functools
import importlib
import math
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from torsight.actuator.drive import Drive
from torsight.actuator.ports import Ports
from torsight.core.errors import ConfigError
from torsight.core.parameter import Parameter
from torsight.core.units import Floats
from torsight.core.words.shown import Shown
from torsight.core.words.wording import meant, number

ActsOn = Literal["clock", "temperature", "phase", "torque", "friction", "reading"]
Values = Mapping[str, float]
STAGES: Final = ("clock", "temperature", "phase", "torque", "friction", "reading")
"""Stages at which effects and laws act, in their order."""


@dataclass(frozen=True, slots=True)
class Derived:
    """A value for the report that is computed from fitted parameters."""

    name: str
    unit: str
    """Public name and unit."""
    value: Callable[[Values], float]
    """Function of the values of the effect's parameters."""
    period: float | None = None
    """Period of an angular value: its interval is unwrapped around the value."""
    symbol: str = ""
    title: str = ""
    """Symbol in the effect's equation, and meaning in a few words."""


def amplitude_and_phase(
    sine: str, cosine: str, *, unit: str, names: tuple[str, str], symbols: tuple[str, str], titles: tuple[str, str]
) -> tuple[Derived, Derived]:
    """Return amplitude and phase of a wave from its sine and its cosine part, each with name, symbol and title."""
    (amplitude, phase), (size, angle), (of_size, of_angle) = names, symbols, titles
    return (
        Derived(amplitude, unit, lambda v: math.hypot(v[sine], v[cosine]), symbol=size, title=of_size),
        Derived(phase, "rad", lambda v: math.atan2(v[cosine], v[sine]), math.tau, symbol=angle, title=of_angle),
    )


def unknown_share(name: str, *, symbol: str, title: str) -> Parameter:
    """Return the parameter of a share of which nothing is known: mean and deviation are those of an even density."""
    return Parameter(name, 0.5, "", 0.0, 1.0, sigma=12.0**-0.5, null=0.0, symbol=symbol, title=title)


def share(name: str, start: float, *, symbol: str, title: str) -> Parameter:
    """Return the parameter of a share that is usually none or the whole: one half is one standard deviation off."""
    return Parameter(name, start, "", 0.0, 1.0, sigma=0.5, symbol=symbol, title=title)


@dataclass(frozen=True, slots=True, repr=False)
class Effect(Shown):
    """One effect as a declaration.

    Attributes
    ----------
    id : str
        Name in files, code and report; the module's name.
    family : str
        Kind of mechanism that rival effects share (``sensor``, ``clock``, ``heat``, ``friction``, ``mechanics``,
        ``material``, ``camera``; ``start``, ``form`` and ``remainder`` are always fitted).
    acts_on : str
        Where it acts: clock, temperature, phase, torque, friction or reading.
    title : str
        A few plain words.
    parameters : tuple of Parameter
        With unit, bounds, start value and the null value at which the effect vanishes; names are unique over all
        effects.
    apply : callable
        Pure function from ports and values (public units) to ports.
    starts : tuple of mappings
        Further start values of a fit, by parameter name.
    starts_from : callable or None
        Function from the measured angle (rad, NaN where not measured) to further start values.
    derived : tuple of Derived
        Further values for the report, computed from the fitted ones (amplitude and phase of a sine and a cosine).
    event : str or None
        Name of the parameter that is a time (s), where the effect is an event that happens once in a record; the size
        of the event is the parameter with a null value.
    seen : callable or None
        Log-likelihood ratio of what is known beside the fitted rows, with the effect against without it: a function of
        the prepared record, the times of the fitted rows (s), and the parameters' values.
    jumps : bool
        True where the effect changes the instants at which the angle jumps, to which derivatives are hardly sensitive:
        its positive parameters are then also searched without derivatives.
    is_clock : bool
        True for an error between two recorders' clocks, which is not applied in predictions.
    order : int
        Order among effects of the same stage, ascending; effects of equal order act in the order of their ids.
    laws : tuple of str
        Ids of the laws (:mod:`torsight.actuator.laws`) of which the effect is a usual form.
    """

    id: str
    family: str
    acts_on: ActsOn
    title: str
    parameters: tuple[Parameter, ...]
    apply: Callable[[Ports, Values], Ports]
    starts: tuple[Values, ...] = ()
    starts_from: Callable[[Floats], tuple[Values, ...]] | None = None
    derived: tuple[Derived, ...] = ()
    event: str | None = None
    seen: Callable[[Drive, Floats, Values], float] | None = None
    jumps: bool = False
    is_clock: bool = False
    order: int = 0
    laws: tuple[str, ...] = ()

    def facts(self) -> dict[str, str]:
        """Return id, title, family and stage, and each parameter's range."""
        facts = {"id": self.id, "title": self.title, "family": self.family, "acts on": self.acts_on}
        for one in self.parameters:
            facts[one.name] = f"starts at {number(one.value)}, {number(one.lower)} to {number(one.upper)} {one.unit}"
        return facts

    def _columns(self) -> dict[str, Any]:
        """Return one row per parameter; NaN: no prior, or no value at which the effect vanishes."""
        names = {"parameter": "name", "unit": "unit", "start": "value", "lower": "lower", "upper": "upper"}
        names |= {"sigma": "sigma", "null": "null"}
        return {key: [getattr(one, name) for one in self.parameters] for key, name in names.items()}

    def _draw(self, axes: Any) -> None:
        """Draw each parameter's start value and bounds."""
        for place, one in enumerate(self.parameters):
            axes.plot([one.lower, one.upper], [place, place], "|-", color="0.6")
            axes.plot(one.value, place, "o", color="C0")
        labels = [f"{one.name}, {one.unit}" if one.unit else one.name for one in self.parameters]
        axes.set_yticks(range(len(labels)), labels)
        axes.set(xlabel="start and bounds, in the parameter's unit", ylabel="parameter")


@functools.cache
def load_effects() -> Mapping[str, Effect]:
    """Return all effects of this folder by id, in the order of their ids."""
    found = {}
    folder = importlib.import_module(__name__).__path__
    for module in sorted(pkgutil.iter_modules(folder), key=lambda item: item.name):
        effect = importlib.import_module(f"{__name__}.{module.name}").EFFECT
        if effect.id != module.name:
            msg = f"{module.name}.py of {__name__} declares the id {effect.id}"
            raise ValueError(msg)
        found[effect.id] = effect
    return found


def always_fitted() -> tuple[Effect, ...]:
    """Return the effects that every fit includes beside the characterised values and that discovery never names.

    They describe the springs' state before the record (family ``start``), the deviation of the phase law's form
    (``form``), and the remaining offset between the clocks (``remainder``).
    """
    return tuple(effect for effect in load_effects().values() if effect.family in ("start", "form", "remainder"))


def chosen_effects(ids: tuple[str, ...]) -> tuple[Effect, ...]:
    """Return the effects with the given ids, in the order in which they act."""
    known = load_effects()
    for name in ids:
        if name not in known:
            do = meant(name, known) or None
            raise ConfigError(f"effect '{name}' is not known", where="effects", limit=", ".join(known), do=do)
    chosen = (known[name] for name in set(ids))
    # Stage (clocks first, the camera last), then order, then id.
    return tuple(sorted(chosen, key=lambda effect: (STAGES.index(effect.acts_on), effect.order, effect.id)))


__all__ = [
    "Derived", "Effect", "Parameter", "Ports", "Values", "amplitude_and_phase", "load_effects", "share",
    "unknown_share",
]  # fmt: skip
