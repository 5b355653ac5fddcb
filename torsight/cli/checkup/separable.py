"""Effects that discovery will be able to find under a temperature programme, before anything is filmed.

Every effect of the library is put into the model at its usual size. The plain model, and the model with every other
effect, are then fitted to these angles with their free parameters and those of the effects that every fit has, within
the priors (linear in the parameters). The gain from the residual is compared with the gains that the engine requires
for accepting an effect and for separating two.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from statistics import NormalDist
from typing import Final

import numpy as np

from torsight.actuator.drive import Drive
from torsight.actuator.effects import always_fitted, load_effects
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec
from torsight.cli.checkup.finding import RESIDUAL_DEG
from torsight.core.progress import Progress
from torsight.core.units import DEG, Floats
from torsight.discovery.design.separation import Rival, linear_gains
from torsight.discovery.settings import Settings
from torsight.discovery.weight import Weight

_SPREAD: Final = 2.0 * NormalDist().inv_cdf(19.0 / 20.0)
"""A gain scatters by twice its root (a noncentral χ²): an effect called visible is found nineteen times in twenty."""


@dataclass(frozen=True, slots=True)
class Separable:
    """Effects that the record will show: those that the plain model cannot absorb are visible, the others are hidden.

    ``alike`` are pairs of visible effects that absorb each other; ``left_deg`` is the residual of the plain model for
    each effect at its usual size, degrees rms.
    """

    visible: tuple[str, ...]
    hidden: tuple[str, ...]
    alike: tuple[tuple[str, str], ...]
    left_deg: dict[str, float]


def separable(spec: ActuatorSpec, drive: Drive, *, progress: Progress) -> Separable:
    """Return which effects a record with this drive would show, and which of them it could distinguish."""
    fitted = always_fitted()
    missing = [effect for effect in load_effects().values() if effect not in fitted and effect.event is None]
    # Those that change the model at their start values.
    effects = [one for one in missing if any(p.null is not None and p.value != p.null for p in one.parameters)]
    # A sample counts as its interval over the correlation time of a good record's residual, ten seconds: a choice.
    weight = np.gradient(drive.time_s) / 10.0 / (RESIDUAL_DEG * DEG) ** 2 * drive.known
    always = tuple(effect.id for effect in fitted)
    models = {chosen: ActuatorModel(spec, chosen) for chosen in [always, *((*always, effect.id) for effect in effects)]}
    explanations = [
        Rival(chosen, chosen, model.parameters, np.array([parameter.value for parameter in model.parameters]))
        for chosen, model in models.items()
    ]
    needed = sum(1 + len(one.x) for one in explanations)
    done = 0

    def predict(values: Mapping[str, float], rival: Rival) -> Floats:
        nonlocal done
        done = min(done + 1, needed)
        progress("what discovery can tell", done, needed)
        return models[rival.effects].angle_rad(drive, values)

    gains = linear_gains(predict, explanations, Weight.of(weight))
    progress("what discovery can tell", needed, needed)
    names = [effect.id for effect in effects]
    # The first row and column belong to the plain model; the row is the model taken as true.
    left = dict(zip(names, np.maximum(gains[1:, 0], 0.0).tolist(), strict=True))
    settings = Settings()
    least = 2.0 * settings.price(len(names)) + settings.surely
    visible = tuple(name for name in names if left[name] - _SPREAD * math.sqrt(left[name]) >= least)
    between = {
        (one, other): min(gains[i, j], gains[j, i])
        for (i, one), (j, other) in combinations(enumerate(names, start=1), 2)
    }
    return Separable(
        visible=visible,
        hidden=tuple(name for name in names if name not in visible),
        alike=tuple(pair for pair, gain in between.items() if set(pair) <= set(visible) and gain < settings.apart),
        left_deg={name: math.sqrt(gain / float(np.sum(weight))) / DEG for name, gain in left.items()},
    )
