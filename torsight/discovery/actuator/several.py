"""Several records of one rig as one problem.

Values, effects and laws belong to the rig and are shared by all records. Each record has its own winding of the springs
at its start (effects of the family ``start``), zero of the sticks, offset of the clocks, and events of its camera or
markers. Names of record 2, 3, … end in ``_2``, ``_3``, …; those of record 1 have no ending.

Records are in the order in which they were made: the springs' cycles, on which effects and laws of fatigue depend, are
counted through all records. Records do not share a time: a law of time is a function of its own in each of them, all of
one size and smoothness.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from torsight.actuator.drive import Drive
from torsight.actuator.effects import load_effects
from torsight.actuator.effects.clock_offset import EFFECT as CLOCK_OFFSET
from torsight.actuator.laws import FAMILIES
from torsight.actuator.ports import History
from torsight.actuator.spec import ActuatorSpec
from torsight.core.law import TIME, Law, LawForm
from torsight.core.parameter import Parameter
from torsight.core.units import Floats, Ints
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.inference.law.measure import Measured
from torsight.discovery.interface import Candidate, OptionalMembers, known_of

ZERO: Final = "zero_deg"
_SAMPLES: Final = ("time_s", "observed", "sigma", "valid", "block", "rest", "share", "drivers")
_OF_THE_RECORDS: Final = ("_clocks", "_joined", "_starts_s", "laws", *_SAMPLES)
"""Attributes that depend on the records alone, and are kept when other laws are tried on the same records."""


def own_name(name: str, record: int) -> str:
    """Return the name of a record's own value or event; records count from 0."""
    return name if record == 0 else f"{name}_{record + 1}"


def _joined_rows(name: str) -> cached_property[NDArray[Any]]:
    """Return the member (n,) of a joint problem that is the concatenation of the records' own."""
    return cached_property(lambda joint: np.concatenate([getattr(part, name) for part in joint.parts]))


@dataclass(frozen=True, eq=False)
class SeveralRecords(OptionalMembers):
    """Records of one rig with the plain model and every effect as a candidate.

    ``parts`` are the problems of the records of one actuator, in the order in which they were made (see :meth:`of`);
    ``forms`` are measured laws that are candidates, too.
    """

    in_copies: ClassVar[bool] = True
    parts: tuple[ActuatorProblem, ...]
    forms: tuple[LawForm, ...] = ()
    # As in the protocol, one record after the other.
    observed = _joined_rows("observed")
    sigma = _joined_rows("sigma")
    valid = _joined_rows("valid")
    rest = _joined_rows("rest")
    share = _joined_rows("share")
    input_alike_s = _joined_rows("input_alike_s")

    @classmethod
    def of(cls, drives: Sequence[Drive], spec: ActuatorSpec, *, seed: int = 0) -> SeveralRecords:
        """Return the problem of one actuator's records in their order; ``seed`` is that of the noise that is drawn."""
        parts, cycles = [], (0, 0)
        if any(drive.clock_sigma_s is not None for drive in drives):
            # If the clocks of one record were synchronised, an offset in another record is not an effect of the rig.
            widest_s = CLOCK_OFFSET.parameters[0].upper
            drives = [replace(one, clock_sigma_s=one.clock_sigma_s or widest_s) for one in drives]
        for k, drive in enumerate(drives):
            history = History(cycles=cycles)
            parts.append(ActuatorProblem(drive, spec, seed=seed + k, history=history))
            springs = drive.cycles.springs
            cycles = cycles[0] + springs.count(0), cycles[1] + springs.count(1)
        return cls(tuple(parts))

    @cached_property
    def resolution(self) -> float:
        """Size of a difference, in degrees, below which an effect does not matter."""
        return self.parts[0].resolution

    @cached_property
    def _clocks(self) -> frozenset[str]:
        """Ids of effects that act on all records together, each record with its own values."""
        return frozenset(effect.id for effect in load_effects().values() if effect.is_clock)

    @cached_property
    def own(self) -> frozenset[str]:
        """Names, without a record's ending, of the values that every record has of its own."""
        clocks = (p.name for name in self._clocks for p in load_effects()[name].parameters)
        events = (p.name for c in self.parts[0].candidates if c.event is not None for p in c.parameters)
        return frozenset((ZERO, *self.parts[0].once, *clocks, *events))

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The plain model's free parameters, followed by the later records' own ones."""
        later = [
            replace(p, name=own_name(p.name, k))
            for k, part in enumerate(self.parts)
            for p in part.parameters
            if k > 0 and p.name in self.own
        ]
        return (*self.parts[0].parameters, *later)

    @cached_property
    def candidates(self) -> tuple[Candidate, ...]:
        """Every effect, one for all records; events of each record; then the measured laws."""
        found: list[Candidate] = []
        for each in zip(*(part.candidates for part in self.parts), strict=True):
            if each[0].event is not None:
                found += [replace(_renamed(one, k), id=own_name(one.id, k)) for k, one in enumerate(each)]
            elif each[0].id in self._clocks:
                found.append(_of_each(each))
            else:
                starts = [dict(start) for candidate in each for start in candidate.starts]
                distinct = tuple(start for i, start in enumerate(starts) if start not in starts[:i])
                found.append(replace(each[0], starts=distinct))
        return tuple(found)

    @cached_property
    def _joined(self) -> ActuatorProblem:
        """The concatenated records, for quantities that depend on the range that they cover together."""
        return replace(self.parts[0], drive=_joined([part.drive for part in self.parts], self._starts_s), forms=())

    @cached_property
    def laws(self) -> tuple[Law, ...]:
        """Laws that may be missing, over the range that any of the records covers."""
        shared = (law for law in self._joined.laws if law.driver != TIME)
        own = ({law.id: law for law in part.laws if law.driver == TIME} for part in self.parts)
        first, *others = own
        return (*shared, *(self._of_each_time([law, *(one[name] for one in others)]) for name, law in first.items()))

    def _of_each_time(self, each: Sequence[Law]) -> Law:
        """Return one law of time for all records: their nodes one after the other, independent between records."""
        kernels = (
            replace(bank[0], matrix=np.asarray(block_diag(*(kernel.matrix for kernel in bank)), np.float64))
            for bank in zip(*(law.kernels for law in each), strict=True)
        )
        nodes = np.concatenate([law.nodes + start for law, start in zip(each, self._starts_s, strict=True)])
        return replace(each[0], nodes=nodes, kernels=tuple(kernels), covered=(nodes[0], nodes[-1]))

    def own_form(self, form: LawForm, record: int) -> LawForm:
        """Return a law's form as it acts on a record: for a law of time, the record's own nodes in its own time."""
        if FAMILIES[form.id].driver != TIME:
            return form
        drive, start = self.parts[record].drive, self._starts_s[record]
        ends = start + drive.time_s[0], start + drive.time_s[-1]
        own = slice(np.searchsorted(form.nodes, ends[0]), np.searchsorted(form.nodes, ends[1], side="right"))
        return replace(form, nodes=form.nodes[own] - start, basis=form.basis[own])

    def own_law(self, measured: Measured, record: int) -> Measured:
        """Return a measured law as it acts on a record: a law of time is the record's own, in its own time."""
        form = self.own_form(measured.form, record)
        if form is measured.form:
            return measured
        law = next(law for law in self.parts[record].laws if law.id == measured.law.id)
        return replace(measured, law=law, form=form)

    def with_laws(self, forms: Sequence[LawForm]) -> SeveralRecords:
        """Return the problem with these forms of laws among its candidates."""
        parts = (part.with_laws([self.own_form(form, k) for form in forms]) for k, part in enumerate(self.parts))
        other = SeveralRecords(tuple(parts), tuple(forms))
        vars(other).update(known_of(self, _OF_THE_RECORDS))
        return other

    @cached_property
    def _idle(self) -> tuple[frozenset[str], ...]:
        """Names of laws' coefficients that act on other records only, for every record."""
        return tuple(
            frozenset(
                name
                for form in part.forms
                for name, used in zip(form.names, np.any(form.basis, axis=0).tolist(), strict=True)
                if not used
            )
            for part in self.parts
        )

    @cached_property
    def _starts_s(self) -> list[float]:
        """Shift of each record's times so that they increase through all records, s."""
        starts, end_s = [], 0.0
        for k, part in enumerate(self.parts):
            time_s = part.drive.time_s
            starts.append(end_s - float(time_s[0]) if k else 0.0)
            # A gap as long as the record is longer than any correlation time within it.
            end_s = starts[-1] + float(time_s[-1]) + float(np.ptp(time_s))
        return starts

    def get_ready(self) -> None:
        """Compute the wires' temperatures behind slow sensors."""
        for part in self.parts:
            part.get_ready()

    def __getstate__(self) -> dict[str, object]:
        """Return the state that is pickled: all but candidates, which hold functions."""
        return known_of(self, ("parts", "forms", *_OF_THE_RECORDS))

    @cached_property
    def once(self) -> tuple[str, ...]:
        """Names of all values that belong to one record: other records do not determine them."""
        return tuple(own_name(name, k) for k in range(len(self.parts)) for name in sorted(self.own))

    @cached_property
    def elsewhere(self) -> tuple[Mapping[str, float], ...]:
        """Further start values of the records' own values: of one record at a time, and of all records together."""
        each = [
            [{own_name(name, k): value for name, value in place.items()} for place in part.elsewhere]
            for k, part in enumerate(self.parts)
        ]
        together = [
            {name: value for place in places for name, value in place.items()} for places in zip(*each, strict=True)
        ]
        return (*(place for places in each for place in places), *together)

    @cached_property
    def time_s(self) -> Floats:
        """Film times, those of later records shifted so that they increase."""
        return np.concatenate([part.time_s + start for part, start in zip(self.parts, self._starts_s, strict=True)])

    @cached_property
    def block(self) -> Ints:
        """Number of each row's half-cycle, counted through all records."""
        firsts = self.opening_blocks
        return np.concatenate([part.block + first for part, first in zip(self.parts, firsts, strict=True)])

    @cached_property
    def opening_blocks(self) -> tuple[int, ...]:
        """Number of each record's first half-cycle."""
        counts = [len(part.drive.cycles.springs) for part in self.parts]
        return tuple(int(first) for first in np.cumsum([0, *counts[:-1]]))

    @cached_property
    def record(self) -> Ints:
        """Record of each row, from 0."""
        return np.repeat(np.arange(len(self.parts)), [len(part.time_s) for part in self.parts])

    def rows_of(self, record: int) -> slice:
        """Return the rows of a record."""
        ends = np.cumsum([0, *(len(part.time_s) for part in self.parts)])
        return slice(int(ends[record]), int(ends[record + 1]))

    @cached_property
    def drivers(self) -> Mapping[str, Floats]:
        """Variables on which a missing effect may depend."""
        each = [part.drivers for part in self.parts]
        return {name: np.concatenate([drivers[name] for drivers in each]) for name in each[0]}

    def effect_of(self, candidate: str) -> str:
        """Return the id of a candidate's effect, without the record's ending."""
        return self._places.get(candidate, (candidate, None))[0]

    @cached_property
    def _places(self) -> dict[str, tuple[str, int]]:
        """Events' ids to the effect and the record."""
        events = [c.id for c in self.parts[0].candidates if c.event is not None]
        return {own_name(name, k): (name, k) for name in events for k in range(len(self.parts))}

    def effects_of(self, record: int, effects: Sequence[str]) -> tuple[str, ...]:
        """Return the members of a set that act on a record, by the effects' own ids."""
        placed = (self._places.get(name, (name, record)) for name in effects)
        return tuple(effect for effect, place in placed if place == record)

    def values_of(self, record: int, values: Mapping[str, float]) -> dict[str, float]:
        """Return the values for a record's own model: the shared ones, and its own without their ending."""
        once = frozenset(self.once)
        shared = {name: value for name, value in values.items() if name not in once}
        own = {name: values[own_name(name, record)] for name in self.own if own_name(name, record) in values}
        return {**shared, **dict.fromkeys(self._idle[record] & shared.keys(), 0.0), **own}

    def joint_name(self, record: int, name: str) -> str:
        """Return the name, among the parameters of all records, of a parameter of a record's own model."""
        return own_name(name, record) if name in self.own else name

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the angles in degrees as the cameras would read them."""
        return np.concatenate([part.predict(*own) for part, own in self._owns(values, effects)])

    def predict_many(self, values: Sequence[Mapping[str, float]], effects: Sequence[str]) -> list[Floats]:
        """Return ``predict`` at several points, of which many differ in values that only one of the records has."""
        each = []
        for k, part in enumerate(self.parts):
            own_effects, points = self.effects_of(k, effects), [self.values_of(k, one) for one in values]
            keys = [tuple(point.values()) for point in points]
            distinct = dict(zip(keys, points, strict=True))
            found = {key: part.predict(point, own_effects) for key, point in distinct.items()}
            each.append([found[key] for key in keys])
        return [np.concatenate(parts) for parts in zip(*each, strict=True)]

    def input_noise(self, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the angles' noise (n,) from the temperatures' remaining noise, without that of half-cycles' tops."""
        return np.concatenate([part.input_noise(*own) for part, own in self._owns(values, effects)])

    def shared_errors(self, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the change (n, k) of the angles by one standard deviation of each of k errors that samples share."""
        return np.asarray(block_diag(*(part.shared_errors(*own) for part, own in self._owns(values, effects))))

    def curve_of(self, effect: str, law: Law, values: Mapping[str, float]) -> Floats | None:
        """Return the law's values on its nodes that reproduce an effect, in the first record."""
        return self.parts[0].curve_of(self.effect_of(effect), law, self.values_of(0, values))

    def also_seen(self, values: Mapping[str, float], effects: Sequence[str]) -> float:
        """Return the log likelihood of the effects from rows that are not fitted."""
        return sum(part.also_seen(*own) for part, own in self._owns(values, effects))

    def _owns(
        self, values: Mapping[str, float], effects: Sequence[str]
    ) -> Iterator[tuple[ActuatorProblem, tuple[dict[str, float], tuple[str, ...]]]]:
        """Yield the records' problems, each with the values and effects for its own model."""
        for k, part in enumerate(self.parts):
            yield part, (self.values_of(k, values), self.effects_of(k, effects))


def _renamed(candidate: Candidate, k: int) -> Candidate:
    """Return a candidate with a record's parameter names."""
    return replace(
        candidate,
        parameters=tuple(replace(p, name=own_name(p.name, k)) for p in candidate.parameters),
        starts=tuple({own_name(name, k): value for name, value in start.items()} for start in candidate.starts),
        scales={own_name(name, k): scale for name, scale in candidate.scales.items()},
        event=None if candidate.event is None else own_name(candidate.event, k),
    )


def _of_each(each: Sequence[Candidate]) -> Candidate:
    """Return one candidate with every record's own values of an effect, all with the same starts."""
    renamed = [_renamed(candidate, k) for k, candidate in enumerate(each)]
    together = zip(*(candidate.starts for candidate in renamed), strict=True)
    return replace(
        each[0],
        parameters=tuple(p for candidate in renamed for p in candidate.parameters),
        starts=tuple({name: value for start in starts for name, value in start.items()} for starts in together),
        scales={name: scale for candidate in renamed for name, scale in candidate.scales.items()},
    )


def _joined(drives: Sequence[Drive], starts: Sequence[float]) -> Drive:
    """Return the concatenated records as one drive, for the ranges that they cover; it is never simulated.

    ``starts`` are the shifts of the records' times, s.
    """
    halves = np.cumsum([0, *(len(drive.cycles.springs) for drive in drives)])
    cycles = replace(
        drives[0].cycles,
        active=np.concatenate([drive.cycles.active for drive in drives]),
        half=np.concatenate([drive.cycles.half + first for drive, first in zip(drives, halves[:-1], strict=True)]),
        springs=tuple(spring for drive in drives for spring in drive.cycles.springs),
    )

    names = ("temp_a_c", "temp_b_c", "rate_a_c_s", "rate_b_c_s", "angle_rad")
    joined: dict[str, Any] = {name: np.concatenate([getattr(drive, name) for drive in drives]) for name in names}
    return replace(
        drives[0],
        time_s=np.concatenate([drive.time_s + start for drive, start in zip(drives, starts, strict=True)]),
        cycles=cycles,
        **joined,
    )
