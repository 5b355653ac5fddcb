"""Signals of a record beside its outputs: the drivers on which effects may depend, and where everything is at rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from torsight.core.errors import InputError
from torsight.core.units import Flags, Floats
from torsight.discovery.own.model import layout as lay
from torsight.discovery.own.model.ode import EQUAL
from torsight.discovery.own.own_records import Record, column_of, time_column


def rest_of(
    given: str | None, records: Sequence[Record], outputs: Sequence[str], measured: Sequence[Floats], noise: list[float]
) -> tuple[list[Flags], list[str]]:
    """Return the rows (rows,) in which every record is at rest, and warnings about rests."""
    if given is not None and given != "still":
        return [np.nan_to_num(column_of(record, given)) != 0.0 for record in records], []
    found = [np.logical_and.reduce([lay.still(own[:, k], noise[k]) for k in range(len(outputs))]) for own in measured]
    share = float(np.mean(np.concatenate(found)))
    if given == "still":
        return found, []
    note = (
        f"{100 * share:.0f} % of the record stands still, and every sample of it counts: rest='still' makes each "
        "such stretch count as one piece of information"
    )
    return [np.zeros(record.rows_, bool) for record in records], [note] if share > 0.5 else []


def drivers_of(
    given: Sequence[str] | None,
    records: Sequence[Record],
    outputs: Sequence[str],
    times: Sequence[Floats],
    *,
    reading: lay.Reading,
) -> tuple[dict[str, list[Floats]], list[str]]:
    """Return the drivers by name, one array per record, and notes on the columns that were left out."""
    no_drivers = {*outputs, reading.time, reading.blocks if isinstance(reading.blocks, str) else None}
    shared = [name for name in records[0] if all(name in record for record in records)]
    names = (
        [name for name in shared if name not in no_drivers and time_column([name]) is None]
        if given is None
        else list(given)
    )
    found: dict[str, list[Floats]] = {}
    notes: list[str] = []
    for name in names:
        own = [column_of(record, name) for record in records]
        twin = name if name in outputs else _twin(own, records, outputs)
        if twin is not None:
            notes.append(
                f"'{name}' is what is measured ({twin}), noise included: it was left out of the drivers, because it "
                "would explain the residual on its own; give the variable from another sensor, or a law's driver"
            )
        elif all(np.isfinite(one).all() for one in own):
            found[name] = own
        elif given is not None:
            raise InputError("is not known in every row", where=f"driver '{name}'", do="fill its gaps, or leave it out")
    if given is None or "time_s" in given:
        found["time_s"] = [own - own[0] for own in times]
    return found, notes


def _twin(own: Sequence[Floats], records: Sequence[Record], outputs: Sequence[str]) -> str | None:
    values = np.concatenate(list(own))
    for output in outputs:
        measured = np.concatenate([record[output] for record in records])
        good = np.isfinite(values) & np.isfinite(measured)
        if good.sum() > 2 and _same(values[good], measured[good]):
            return output
    return None


def _same(values: Floats, measured: Floats) -> bool:
    """Return whether two signals are equal up to scale and offset, noise included: one in other units.

    Other columns that are computed from the signal are recognised once the model is fitted
    (:mod:`torsight.discovery.own.reading_error`).
    """
    if min(np.ptp(values), np.ptp(measured)) <= 0.0:
        return False
    return float(np.std(left_beside(values[:, None], measured))) < EQUAL * float(np.std(measured))


def left_beside(columns: Floats, values: Floats) -> Floats:
    """Return the residual (n,) of a least-squares fit of columns (n, k) and a constant to values (n,)."""
    both = np.column_stack([columns - columns.mean(axis=0), np.ones(len(values))])
    return np.asarray(values - both @ np.linalg.lstsq(both, values)[0])
