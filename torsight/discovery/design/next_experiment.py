"""The experiment that would distinguish rival explanations: a search over temperature programmes.

Every programme is simulated with the thermal model of the record's wires, and each rival predicts the angle. The worth
of a programme is the least gain over all pairs of rivals after a refit (:mod:`.separation`). The search first tries
every kind of half-cycle alone, then mixes the best one with every other; the gains of three finalists are found by
refits. Where even the best one promises little more gain than needed, the finalists are also tried at twice their
length, because the promise holds only for the rig as it was fitted. A gain beyond what is surely enough counts little,
and so does a shorter duration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.drive import Drive
from torsight.core.progress import Progress, silent
from torsight.core.series import known_median
from torsight.core.units import DEG, Floats
from torsight.core.words.wording import capital, effect_name, listed
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.design.programme import Heat, Played, Programme
from torsight.discovery.design.programme_menu import Habits, in_words, menu
from torsight.discovery.design.separation import Rival, least_gain, linear_gains, refitted_gains
from torsight.discovery.inference.explanation import Explanation, Field
from torsight.discovery.inference.noise import Scales, Stretches, information
from torsight.discovery.settings import Settings
from torsight.discovery.weight import Weight

_ENOUGH: Final = 25.0
"""Multiple of the gain at which rivals cease to be rivals beyond which other things than the noise would make the
experiment fail: a distance of 12 standard deviations ..."""
_LITTLE: Final = 4.0
"""... and multiple below which the gain of a programme is too small to rely on."""
NEEDED_GAIN: Final = Settings().apart
"""Gain at which rivals cease to be rivals."""


@dataclass(frozen=True, slots=True, eq=False)
class NextExperiment:
    """The programme that best separates the rivals, in words, by segments and sample by sample.

    A segment holds spring, action, temperatures, rate, hold and duration. The programme promises ``gain``, the least
    over all ``pairs`` of rivals, a plain repeat of the record ``repeat_gain``; at ``needed_gain`` rivals cease to be
    rivals. ``columns`` (n,), with the angle that each rival predicts, are those of ``next_experiment.csv``.
    """

    text: str
    segments: tuple[Mapping[str, Any], ...]
    duration_s: float
    gain: float
    repeat_gain: float
    needed_gain: float
    pairs: tuple[Mapping[str, Any], ...]
    columns: Mapping[str, NDArray[np.generic]]

    def to_json(self) -> dict[str, Any]:
        """Return the entry ``next_experiment`` of ``discovery.json``."""
        return {
            "text": self.text,
            "duration_s": self.duration_s,
            "segments": [dict(segment) for segment in self.segments],
            "separation_gain": self.gain,
            "separation_sigmas": math.sqrt(self.gain),
            "repeat_separation_gain": self.repeat_gain,
            "repeat_separation_sigmas": math.sqrt(self.repeat_gain),
            "needed_gain": self.needed_gain,
            "pairs": [dict(pair) for pair in self.pairs],
            "file": "next_experiment.csv",
        }


def next_experiment(
    problem: ActuatorProblem,
    field: Field,
    explanations: Sequence[Explanation],
    *,
    needed_gain: float,
    progress: Progress = silent,
) -> NextExperiment:
    """Find the temperature programme that best separates the chosen set and its rivals.

    ``needed_gain`` is the gain at which rivals cease to be rivals.
    """
    planner = _Planner(problem, field, explanations, needed_gain, progress)
    repeat = planner.weigh(problem.drive, refitted=True)
    best = planner.best()
    return planner.answer(best, repeat_gain=least_gain(repeat))


@dataclass(frozen=True, slots=True, eq=False)
class _Weighed:
    programme: Programme
    duration_s: float
    gains: Floats

    def worth(self, enough: float) -> float:
        """Return the quantity to maximise: the least gain (beyond ``enough`` a thousandth of it), less 2 % per hour."""
        gain = least_gain(self.gains)
        return min(gain, enough) * (1.0 - 0.02 * self.duration_s / 3600.0) + 1e-3 * min(gain, 100.0 * enough)


@dataclass(eq=False)
class _Planner:
    problem: ActuatorProblem
    field: Field
    explanations: Sequence[Explanation]
    needed_gain: float
    progress: Progress

    def __post_init__(self) -> None:
        problem, chosen = self.problem, self.explanations[0]
        self.rivals = [_rival(problem, one) for one in self.explanations]
        simulation = problem.with_laws(self.rivals[0].forms).simulate(chosen.fit.values, chosen.fit.effects)
        habits = Habits.of(problem.drive, (simulation.xi_a, simulation.xi_b))
        self.heat, self.full_c = Heat.of(problem.drive), habits.full_c
        self.menu = menu(habits, self.heat)
        # An hour, or half as long again as the record.
        self.longest_s = max(3600.0, 1.5 * float(np.ptp(problem.drive.time_s)))

    def best(self) -> _Weighed:
        """Search: every kind of half-cycle alone, mixtures with the best one, then refits for the finalists."""
        names = list(self.menu)
        first_keys = [(name,) * 4 for name in names] + [("usual",) * 8, ("fast",) * 8]
        alone = self._weigh_all(first_keys)
        if not alone:
            # All programmes of this rig last longer than the limit: the limit is lifted.
            self.longest_s = math.inf
            alone = self._weigh_all(first_keys)
        ranked = self._ranked(alone)
        first = ranked[0][0][0]
        mixed = [(first, first, name, name) for name in names] + [(first, name, name, first) for name in names]
        weighed = alone | self._weigh_all([key for key in dict.fromkeys(mixed) if key not in alone])
        whole = {key: item for key, item in weighed.items() if item.programme.completes(self.full_c)}
        finalists = [item for _, item in self._ranked(whole or weighed)[:3]]
        best = self._best_refitted([item.programme for item in finalists])
        if least_gain(best.gains) >= _LITTLE * self.needed_gain:
            return best
        again = self._best_refitted([Programme(item.programme.half_cycles * 2) for item in finalists])
        return max(best, again, key=lambda item: item.worth(_ENOUGH * self.needed_gain))

    def _best_refitted(self, programmes: Sequence[Programme]) -> _Weighed:
        found = (self._weighed_under(programme, self._drive(programme), refitted=True) for programme in programmes)
        return max(found, key=lambda item: item.worth(_ENOUGH * self.needed_gain))

    def weigh(self, drive: Drive, *, refitted: bool) -> Floats:
        """Return the gains (k, k) from a record under these temperatures; see :mod:`.separation`."""
        planned, weight = self._planned(drive)
        gains = refitted_gains if refitted else linear_gains

        def predict(values: Mapping[str, float], rival: Rival) -> Floats:
            return planned.with_laws(rival.forms).predict(values, rival.effects)

        return gains(predict, self.rivals, weight)

    def answer(self, best: _Weighed, *, repeat_gain: float) -> NextExperiment:
        """Return the best programme with its words and columns."""
        played = best.programme.play(self.heat)
        gain = least_gain(best.gains)
        names = [" with ".join(effect_name(name) for name in one.name) for one in self.rivals]
        gains = {"gain": gain, "repeat_gain": repeat_gain, "needed_gain": self.needed_gain}
        text = _sentence(in_words(best.programme), names, **gains)
        return NextExperiment(
            text=text,
            segments=played.segments,
            duration_s=best.duration_s,
            **gains,
            pairs=tuple(self._pairs(best.gains)),
            columns=self._columns(played),
        )

    def _weigh_all(self, keys: Sequence[tuple[str, ...]]) -> dict[tuple[str, ...], _Weighed]:
        programmes = {key: Programme(tuple(self.menu[name] for name in key)) for key in keys}
        asked = list(programmes.values())
        found: list[_Weighed | None] = self.problem.at_once(
            asked, self._weighed, step="next experiment", progress=self.progress
        )
        return {key: item for key, item in zip(programmes, found, strict=True) if item is not None}

    def _weighed(self, programme: Programme) -> _Weighed | None:
        drive = self._drive(programme)
        return None if drive.time_s[-1] > self.longest_s else self._weighed_under(programme, drive, refitted=False)

    def _weighed_under(self, programme: Programme, drive: Drive, *, refitted: bool) -> _Weighed:
        return _Weighed(programme, float(drive.time_s[-1]), self.weigh(drive, refitted=refitted))

    def _ranked(self, weighed: Mapping[tuple[str, ...], _Weighed]) -> list[tuple[tuple[str, ...], _Weighed]]:
        return sorted(weighed.items(), key=lambda item: (-item[1].worth(_ENOUGH * self.needed_gain), item[0]))

    def _drive(self, programme: Programme) -> Drive:
        return programme.play(self.heat).drive(start_angle_rad=self.problem.drive.start_angle_rad)

    def _angle_rad(self, rival: Rival, drive: Drive) -> Floats:
        model = self.problem.with_laws(rival.forms).model(rival.effects)
        return model.angle_rad(drive, rival.values(rival.x))

    def _planned(self, drive: Drive) -> tuple[ActuatorProblem, Weight]:
        """Return the planned record as a problem, and the weight of its samples."""
        own, first = self.problem.drive, self.rivals[0]
        values, angle_rad = first.values(first.x), self._angle_rad(first, drive)
        sigma_rad = float(np.nan_to_num(known_median(own.angle_sigma_rad)))
        planned = ActuatorProblem(
            replace(
                drive,
                angle_rad=angle_rad,
                angle_sigma_rad=np.full(len(drive), sigma_rad),
                temp_sigma_c=np.full(len(drive), float(np.median(own.temp_sigma_c))),
                noise_c=own.noise_c,
                clock_sigma_s=own.clock_sigma_s,
            ),
            self.problem.spec,
            seed=self.problem.seed,
        )
        # Under temperatures that it was not fitted to, a model is no more exact than the resolution.
        least, tau = self.problem.resolution, self.field.likelihood.correlation_samples
        chosen = self.explanations[0]
        left = chosen.likelihood.discrepancy(chosen.residual).tolist()
        wider = Scales(math.hypot(left[0], least), math.hypot(left[1], least), tau)
        known = planned.with_laws(first.forms)
        floor = np.hypot(planned.sigma, known.input_noise(values, first.effects))
        each = information(Stretches.of(planned), wider, floor)
        return planned, replace(each, shared=known.shared_errors(values, first.effects))

    def _pairs(self, gains: Floats) -> list[dict[str, Any]]:
        found = []
        for j, second in enumerate(self.rivals):
            for i, first in enumerate(self.rivals[:j]):
                both = gains[[i, j], [j, i]]
                gain = least_gain(both)
                names = [list(first.name), list(second.name)]
                found.append({"between": names, "gain": gain, "sigmas": math.sqrt(gain)})
        return found

    def _columns(self, played: Played) -> dict[str, NDArray[np.generic]]:
        drive = played.drive(start_angle_rad=self.problem.drive.start_angle_rad)
        columns: dict[str, NDArray[np.generic]] = {
            "time_s": played.time_s,
            "temp_a_c": played.temp_a_c.round(3),
            "temp_b_c": played.temp_b_c.round(3),
            "heat_a": (played.driven == 0).astype(np.int8),
            "heat_b": (played.driven == 1).astype(np.int8),
        }
        turns_deg = 360.0 * self.problem.drive.turns
        for one in self.rivals:
            columns[f"{'+'.join(one.name)}_deg"] = (self._angle_rad(one, drive) / DEG + turns_deg).round(3)
        return columns


def _rival(problem: ActuatorProblem, explanation: Explanation) -> Rival:
    """Return an explanation as it applies to a later record: without the events of this record."""
    events = {candidate.id for candidate in problem.candidates if candidate.event is not None}
    lasting = tuple(name for name in explanation.fit.effects if name not in events)
    own = {p.name for c in problem.candidates if c.id in events for p in c.parameters}
    fitted = zip(explanation.fit.parameters, explanation.fit.solution.x.tolist(), strict=True)
    kept = {p: value for p, value in fitted if p.name not in own}
    forms = tuple(item.form for item in explanation.laws)
    return Rival(explanation.members, lasting, tuple(kept), np.array(list(kept.values())), forms)


def _sentence(words: str, names: Sequence[str], *, gain: float, repeat_gain: float, needed_gain: float) -> str:
    needed = f"{math.sqrt(needed_gain):.1f} are needed"
    if gain < needed_gain:
        none = f"No programme that was tried distinguishes {listed(names)}: measure directly what separates them."
        if f"{math.sqrt(gain):.1f}" == "0.0":
            return f"{none} Under every one of them the explanations predict the same angles after a refit."
        return (
            f"{none} The programme that comes nearest is to {words}; after a refit they then differ by at least "
            f"{math.sqrt(gain):.1f} standard deviations, and {needed}."
        )
    enough = _ENOUGH * needed_gain
    apart = f"at least {math.sqrt(gain):.1f}" if gain < enough else f"more than {math.sqrt(enough):.0f}"
    rivals = f"{listed(names)} then differ by {apart} standard deviations after a refit"
    repeat = f"a repeat of this record by {math.sqrt(repeat_gain):.1f}"
    first = f"{capital(words)}: {rivals} ({repeat}; {needed})."
    if gain >= _LITTLE * needed_gain:
        return first
    return f"{first} That is little more than is needed: the new record may leave the question open, too."
