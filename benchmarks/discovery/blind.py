"""Cases whose missing piece has no form of the library: laws drawn at random, effects in another usual form, pairs.

Every case is a seed. From it come the declared rig, its true values (each off by its declared uncertainty), where the
sticks' zero is, how the springs were wound before the record, the programme of four cycles (rates, tops, incomplete
heatings) and another one for the later record, the noise, and what is hidden. A law's or an effect's strength is found
by running the rig with and without it until it changes the angle by the wanted size (root mean square). 320 cases for
work and as many that are looked at for a report only: 100 clean, 100 laws, 50 forms, 50 pairs, and 20 with a phase law
of another shape.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from blind_hidden import FORMS, PHASE, PLACES, Key, drawn_effect, effect_piece, law_piece, shown_deg, together
from blind_rig import Record, draw_rig, log_uniform, run_rig, seen

FIRST_SEED: Final = {"work": 100_000, "report": 300_000}
COUNTS: Final = {"clean": 100, "law": 100, "form": 50, "pair": 50, "phase": 20}
_SIZE_DEG: Final = (0.3, 10.0)


@dataclass(frozen=True, slots=True)
class Case:
    """One case.

    Attributes
    ----------
    kind : str
        ``clean``, ``law``, ``form`` or ``pair``.
    seed : int
        Everything follows from it.
    effects : tuple of str
        Ids of hidden effects.
    law : (str, str) or None
        Port and driver of a hidden law, in the rig's words (:data:`PLACES`).
    """

    kind: str
    seed: int
    effects: tuple[str, ...] = ()
    law: Key | None = None

    @property
    def name(self) -> str:
        """Short name."""
        hidden = "-over-".join(self.law) if self.law else "+".join(self.effects) or "none"
        return f"{self.kind}-{hidden}-{self.seed}"


def suite(part: str) -> list[Case]:
    """Return the cases of ``work`` or ``report``; any first so many are a fair sample of the whole."""
    seed = FIRST_SEED[part]
    rng = np.random.default_rng(seed)
    names, places = list(FORMS), [place for place in PLACES if place != PHASE]
    made = {
        "clean": [Case("clean", seed + i) for i in range(COUNTS["clean"])],
        "law": [Case("law", seed + 1000 + i, law=places[i % len(places)]) for i in range(COUNTS["law"])],
        "form": [Case("form", seed + 2000 + i, (names[i % len(names)],)) for i in range(COUNTS["form"])],
        "pair": [
            Case("pair", seed + 3000 + i, tuple(names[k] for k in sorted(rng.choice(len(names), 2, replace=False))))
            for i in range(COUNTS["pair"])
        ],
        "phase": [Case("law", seed + 4000 + i, law=PHASE) for i in range(COUNTS["phase"])],
    }
    order = [((i + 0.5) / len(cases), k, case) for k, cases in enumerate(made.values()) for i, case in enumerate(cases)]
    return [case for _, _, case in sorted(order, key=lambda item: item[:2])]


def make_record(case: Case, *, turned: bool | None = None) -> Record:
    """Run the rig of a case; ``turned`` says whether the sticks' zero is off (drawn where left out)."""
    rng = np.random.default_rng(case.seed)
    rig = draw_rig(rng, turned=turned)
    plain = run_rig(rig, ({}, ()))
    pieces = [] if case.law is None else [law_piece(case.law, rng, rig, plain)]
    drawn = {name: drawn_effect(name, case.kind, rng, rig.record.duration_s) for name in case.effects}
    pieces += [effect_piece(name, numbers) for name, numbers in drawn.items()]
    sizes = [piece.sized(rig, plain, wanted_deg=log_uniform(rng, *_SIZE_DEG)) for piece in pieces]
    factors = [factor for factor, _ in sizes]
    details, laws = together(pieces, factors, [1.0] * len(pieces))
    whole = run_rig(rig, (details, laws))
    return replace(
        seen(whole, rig, details),
        sizes_deg={piece.name: size for piece, (_, size) in zip(pieces, sizes, strict=True)},
        shown_deg=shown_deg(rig, pieces, factors) if pieces else {},
        details=details,
        law=laws[0] if laws else None,
    )
