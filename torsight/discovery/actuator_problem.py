"""The torsion actuator as a problem for the engine.

The plain model is the quasi-static one with its characterised values as priors; the candidates are the effect files;
the blocks are half-cycles; rests are where the measured angle stands still. Angles are in degrees here, the unit of the
report.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import ClassVar, Final

import numpy as np

from torsight.actuator.drive import Drive
from torsight.actuator.effects import Effect, always_fitted, load_effects
from torsight.actuator.effects.clock_offset import EFFECT as CLOCK_OFFSET
from torsight.actuator.fit_result import middle_deg
from torsight.actuator.laws import FAMILIES, laws_of
from torsight.actuator.model import ActuatorModel, PhaseLaw
from torsight.actuator.ports import History, Ports
from torsight.actuator.simulation import Simulation
from torsight.actuator.spec import ActuatorSpec
from torsight.core.law import Law, LawForm
from torsight.core.parameter import Parameter
from torsight.core.series import pair_means
from torsight.core.units import DEG, Flags, Floats, Ints
from torsight.core.words.wording import EXPLAINED, RESOLUTION_DEG
from torsight.discovery.actuator.kept_rows import kept_rows, rest_mask, way_of
from torsight.discovery.actuator.temperature_errors import (
    alike_s,
    are_negligible,
    lasting_errors,
    smooth_errors,
    with_errors,
)
from torsight.discovery.interface import Candidate, OptionalMembers, known_of

_SAMPLES: Final = ("rows", "share", "time_s", "_means", "valid", "block", "rest")
_OF_THE_RECORD: Final = (*_SAMPLES, "drivers", "laws", "_smooth_drives", "_lasting_drives", "_begun")
"""Members that depend on the record alone, and are not computed again where other laws are tried on it."""


@dataclass(frozen=True, eq=False)
class ActuatorProblem(OptionalMembers):
    """One prepared record with the plain model and every effect as a candidate.

    The model is stepped through few rows only (:func:`kept_rows`): rows between which angle and temperatures change
    little carry no information. Effects that need temperatures of other times take them from all rows.

    Attributes
    ----------
    drive : Drive
        The prepared record.
    spec : ActuatorSpec
        Characterised values with their uncertainties.
    seed : int
        Seed of the temperature noise that is drawn and driven through the model.
    resolution : float
        Size of a difference that does not matter, degrees.
    forms : tuple of LawForm
        Measured laws that are candidates, too.
    history : History
        State of the springs after their earlier records.
    phase_law, theta_l_deg
        As in :class:`~torsight.actuator.model.ActuatorModel`.
    """

    in_copies: ClassVar[bool] = True
    drive: Drive
    spec: ActuatorSpec
    seed: int = 0
    resolution: float = RESOLUTION_DEG
    forms: tuple[LawForm, ...] = ()
    history: History = field(default_factory=History)
    phase_law: PhaseLaw = "liang_rogers"
    theta_l_deg: float | None = None
    _models: dict[tuple[str, ...], ActuatorModel] = field(default_factory=dict, init=False, repr=False, compare=False)
    _begun: dict[Drive, Ports] = field(default_factory=dict, init=False, repr=False, compare=False)

    @cached_property
    def rows(self) -> Ints:
        """Rows of the drive that represent the record."""
        return kept_rows(self.drive, self._way, self._at_rest)

    @cached_property
    def _way(self) -> Floats:
        """Path length from the first row to every row of the drive, in steps of angle, temperatures or time."""
        return way_of(self.drive)

    @cached_property
    def _at_rest(self) -> Flags:
        """Where the measured angle stands still, in every row of the drive."""
        drive = self.drive
        return rest_mask(drive.time_s, drive.angle_rad / DEG, drive.known & np.isfinite(drive.angle_rad))

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The plain model's free parameters, and those of the effects that are always fitted beside them."""
        return tuple(self._clock_known(parameter) for parameter in self.model().parameters)

    def _clock_known(self, parameter: Parameter) -> Parameter:
        """Return a parameter; that of the clocks' offset with its prior, zero with the clocks' standard deviation."""
        if parameter.name != CLOCK_OFFSET.parameters[0].name:
            return parameter
        return replace(parameter, value=0.0, sigma=self.drive.clock_sigma_s)

    @cached_property
    def always(self) -> tuple[Effect, ...]:
        """Effects that every fit of this record has beside the characterised values.

        Where the uncertainty of the clocks' synchronisation is known, their offset is no effect that may be missing.
        """
        return (*always_fitted(), *(() if self.drive.clock_sigma_s is None else (CLOCK_OFFSET,)))

    @cached_property
    def candidates(self) -> tuple[Candidate, ...]:
        """Every effect file as a candidate, except those that are always fitted; then the measured laws."""
        effects = [effect for effect in load_effects().values() if effect not in self.always]
        named = [_candidate(effect, self.drive) for effect in effects]
        return (*named, *(Candidate(form.id, "law", form.parameters) for form in self.forms))

    @cached_property
    def laws(self) -> tuple[Law, ...]:
        """Places and variables at which a law may be missing."""
        found = laws_of(self.drive, self.model().nominal()["tau_c_mnm"])
        # Where the clocks were synchronised beforehand, a law of their lead over time is no candidate.
        return found if self.drive.clock_sigma_s is None else tuple(law for law in found if law.id != "clock_time_s")

    def with_laws(self, forms: Sequence[LawForm]) -> ActuatorProblem:
        """Return the problem with these forms of laws among its candidates."""
        other = replace(self, forms=tuple(forms))
        vars(other).update(known_of(self, _OF_THE_RECORD))
        return other

    def get_ready(self) -> None:
        """Compute the wires' temperatures behind slow sensors."""
        self.drive.sensors.get_ready()

    def __getstate__(self) -> dict[str, object]:
        """Return the state of a copy of the process, without models and without candidates, which hold functions."""
        return known_of(self, (*(one.name for one in fields(self)), *_OF_THE_RECORD)) | {"_models": {}}

    @cached_property
    def once(self) -> tuple[str, ...]:
        """Names of the values that describe the state before the record."""
        return tuple(p.name for effect in always_fitted() if effect.family == "start" for p in effect.parameters)

    @property
    def opening_blocks(self) -> tuple[int, ...]:
        """The first half-cycle of the record, where the springs' winding before the record is not known."""
        return (int(self.block[0]),) if self.history.unwound_rad is None else ()

    @cached_property
    def elsewhere(self) -> tuple[Mapping[str, float], ...]:
        """Starts of the effects that are always fitted, and the sticks' zero in the middle of the measured angles."""
        starts = tuple(start for effect in always_fitted() for start in effect.starts)
        zero = ({"zero_deg": middle_deg(self.drive)},) if any(p.name == "zero_deg" for p in self.parameters) else ()
        return (*starts, *zero)

    @cached_property
    def share(self) -> Floats:
        """Share of a step along the record's path that every kept row represents, one at most."""
        return np.minimum(np.gradient(self._way[self.rows]), 1.0)

    @cached_property
    def input_alike_s(self) -> Floats:
        """Integrated correlation time of the temperatures' remaining errors, s."""
        return alike_s(self.drive)[self.rows]

    @cached_property
    def over_floor(self) -> float:
        """Ratio of residual to noise floor above which something is missing, even if no known effect explains it."""
        return EXPLAINED

    @cached_property
    def time_s(self) -> Floats:
        """Film time."""
        return self.drive.time_s[self.rows]

    @cached_property
    def _means(self) -> tuple[Floats, Floats]:
        return _means_between(self.drive, self.rows)

    @property
    def observed(self) -> Floats:
        """Measured angle in degrees, mean over the rows around each kept row."""
        return self._means[0]

    @property
    def sigma(self) -> Floats:
        """Standard deviation of the measured angle in degrees."""
        return self._means[1]

    @cached_property
    def valid(self) -> Flags:
        """Where angle and temperatures are known."""
        return self.drive.known[self.rows] & np.isfinite(self.observed)

    @cached_property
    def block(self) -> Ints:
        """Half-cycle of each row."""
        return np.asarray(self.drive.cycles.half[self.rows], np.int64)

    @cached_property
    def rest(self) -> Flags:
        """Where the measured angle stands still."""
        return self._at_rest[self.rows]

    @cached_property
    def drivers(self) -> Mapping[str, Floats]:
        """Variables that an effect without a name may depend on."""
        from torsight.discovery.actuator.drivers import actuator_drivers

        return actuator_drivers(self.drive, self.rows, self.observed, self.rest)

    def model(self, effects: Sequence[str] = ()) -> ActuatorModel:
        """Return the model with these effects and those that are always fitted."""
        chosen = tuple(effects)
        if chosen not in self._models:
            always = (effect.id for effect in self.always)
            forms = tuple(form for form in self.forms if form.id in chosen)
            effects = tuple(name for name in chosen if name not in {form.id for form in forms})
            effects = (*effects, *always)
            self._models[chosen] = ActuatorModel(self.spec, effects, self.phase_law, self.theta_l_deg, forms)
        return self._models[chosen]

    def simulate(self, values: Mapping[str, float], effects: Sequence[str] = ()) -> Simulation:
        """Simulate the whole record."""
        return self.model(effects).simulate(self.drive, values, history=self.history)

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the angle in degrees as a camera would read it, at the kept rows."""
        return self._predict(self.drive, values, effects)

    def input_noise(self, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the standard deviation of the angle due to residual noise of the temperatures, except that of tops.

        Errors of the size that the conditioning gives are drawn and driven through the model. The unknown instant
        between two rows at which a disk breaks loose after a rest is added.
        """
        clean, jumps = self._seen(self.drive, values, effects)
        found = self._off_by(self._smooth_drives, clean, values, effects)
        return np.sqrt(np.mean(found**2, axis=1) + jumps**2) if found.shape[1] else jumps

    def shared_errors(self, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the change of the angle (n, k), degrees, by one standard deviation of each error that samples share.

        At a top an incomplete transformation ends: the error of the top stays in the angle until the next heating. The
        height of a ripple's peaks is one error for all heatings. Errors that change the angle by less than a tenth of
        the resolution everywhere are left out, such as those of the tops of complete heatings.
        """
        found = self._off_by(self._lasting_drives, self.predict(values, effects), values, effects)
        return found[:, np.max(np.abs(found), axis=0, initial=0.0) > 0.1 * self.resolution]

    def curve_of(self, effect: str, law: Law, values: Mapping[str, float]) -> Floats | None:
        """Return the values on a law's nodes with which it acts as the effect, where the law's family gives them."""
        read, own = FAMILIES[law.id].read, load_effects().get(effect)
        if read is None or own is None or law.id not in own.laws:
            return None
        model = self.model((effect,))
        known = {p.name: values[p.name] for p in model.parameters if p.name in values}
        return read(model.ports(self.drive, known, history=self.history), law.nodes)

    def also_seen(self, values: Mapping[str, float], effects: Sequence[str]) -> float:
        """Return the log-likelihood ratio of the effects from rows that were not fitted, and from the log itself."""
        known = load_effects()
        ways = [known[name].seen for name in effects if name in known]
        return sum(seen(self.drive, self.time_s, values) for seen in ways if seen is not None)

    def _off_by(
        self, drives: Sequence[Drive], clean: Floats, values: Mapping[str, float], effects: Sequence[str]
    ) -> Floats:
        """Return the difference (n, k) of the angle from ``clean`` with other drives than the record's, degrees."""
        if not drives:
            return np.zeros((len(self.rows), 0))
        return np.column_stack([self._predict(drive, values, effects) - clean for drive in drives])

    def _predict(self, drive: Drive, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        return self._seen(drive, values, effects)[0]

    def _seen(self, drive: Drive, values: Mapping[str, float], effects: Sequence[str]) -> tuple[Floats, Floats]:
        """Return the angle at the kept rows and its standard deviation where it jumps between them, degrees."""
        model = self.model(effects)
        if drive not in self._begun:
            self._begun[drive] = model.begin(drive.at(self.rows), history=self.history)
        angle_rad, sigma_rad = model.seen_from(self._begun[drive], values)
        return angle_rad / DEG, sigma_rad / DEG

    @cached_property
    def _smooth_drives(self) -> tuple[Drive, ...]:
        errors = () if are_negligible(self.drive) else smooth_errors(self.drive, seed=self.seed)
        return tuple(with_errors(self.drive, error) for error in errors)

    @cached_property
    def _lasting_drives(self) -> tuple[Drive, ...]:
        errors = () if are_negligible(self.drive) else lasting_errors(self.drive)
        return tuple(with_errors(self.drive, error) for error in errors)


def _means_between(drive: Drive, rows: Ints) -> tuple[Floats, Floats]:
    """Return the mean angle and its sigma, degrees, over equally many rows on either side of each kept row.

    These are at most the rows that lie nearer to no other kept row.
    """
    gap = np.diff(rows)
    half = np.zeros(len(rows), np.int64)
    half[1:-1] = np.minimum(gap[:-1], gap[1:]) // 2
    mean, sigma = pair_means(drive.time_s, drive.angle_rad / DEG, drive.angle_sigma_rad / DEG, rows, half)
    return mean, np.nan_to_num(sigma)


def _candidate(effect: Effect, drive: Drive) -> Candidate:
    measured = () if effect.starts_from is None else effect.starts_from(drive.angle_rad)
    first_s, last_s = float(drive.time_s[0]), float(drive.time_s[-1])
    parameters = tuple(
        replace(p, value=0.5 * (first_s + last_s), lower=first_s, upper=last_s) if p.name == effect.event else p
        for p in effect.parameters
    )
    return Candidate(
        id=effect.id,
        family=effect.family,
        parameters=parameters,
        starts=(*effect.starts, *measured),
        event=effect.event,
        # A time is known to about a second once it is found, whatever its prior or its bounds.
        scales={p.name: 1.0 for p in effect.parameters if p.unit == "s" and p.null is None},
        laws=effect.laws,
        jumps=effect.jumps,
        # Clocks may differ by any function of time.
        any_form=effect.is_clock,
    )
