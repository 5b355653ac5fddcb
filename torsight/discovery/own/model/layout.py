"""Several records and several outputs as the one series of samples that the engine sees.

Records follow one another, and within a record its outputs. A sample that does not count separates any two series, so
that noise is never taken as correlated across them. Several outputs are brought to one scale: each is in units of its
own resolution, and shifted so that no two ranges overlap. A single output stays in its own unit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from torsight.core.errors import InputError
from torsight.core.series import APART, BY_CHANCE, FEWEST, bridged, means_beside, runs, scatter
from torsight.core.units import Flags, Floats, Ints
from torsight.discovery.own.model import given
from torsight.discovery.own.own_records import Record, column_of

_BLOCKS: Final = (int, np.integer, str, list, tuple, np.ndarray, type(None))
PerOutput = float | str | Mapping[str, float | str] | None

_STILL_ROWS: Final = 2 * FEWEST
"""Rows over which a reading must be constant to count as at rest: each half has the fewest rows that show its noise."""


@dataclass(frozen=True, eq=False)
class Reading:
    """How records are read: their noise, the blocks that are held out, where everything stands still, their time.

    Attributes
    ----------
    sigma : float, str or mapping, optional
        Standard deviation of the noise of one reading, a number or a column, by output where there are several.
        By default estimated from the residual's own scatter.
    resolution : float, str or mapping, optional
        Size of a difference that does not matter; by default a tenth of the noise.
    blocks : int, str or sequence of arrays, optional
        Blocks that are held out one at a time: a number of stretches of equal time per record, a column that numbers
        the blocks, or an array of such numbers for each record. By default whole records where there are several, else
        six stretches.
    rest : str, optional
        A column that is not 0 where everything stands still, or ``"still"`` for where the outputs do: such a stretch
        counts as one piece of information.
    time : str, optional
        Column of the time; by default ``time_s``, ``time``, ``t_s`` or ``t``, else the number of the row.
    """

    sigma: PerOutput = None
    resolution: PerOutput = None
    blocks: int | str | Floats | Sequence[Floats] | None = None
    rest: str | None = None
    time: str | None = None

    def __post_init__(self) -> None:
        for what, sizes in (("sigma", self.sigma), ("resolution", self.resolution)):
            each = sizes if isinstance(sizes, Mapping) else {"": sizes}
            for output, one in each.items():
                if one is not None and not isinstance(one, str):
                    given.number(one, f"Reading, {what}{' of ' if output else ''}{output}", positive=True)
        for what, named in (("rest", self.rest), ("time", self.time)):
            if named is not None:
                given.text(named, f"Reading, {what}")
        none = isinstance(self.blocks, (int, np.integer)) and self.blocks < 1
        if none or isinstance(self.blocks, bool) or not isinstance(self.blocks, _BLOCKS):
            limit = "a whole number, 1 or more, a column's name, or an array for each record"
            raise InputError("are no blocks", where="Reading, blocks", value=repr(self.blocks), limit=limit)


@dataclass(frozen=True, eq=False)
class Layout:
    """The engine's series (n,) from outputs (rows, outputs) per record, and back: value = output / scale + shift.

    ``rows`` is the number of rows of each record; scale and shift are (outputs,).
    """

    outputs: tuple[str, ...]
    rows: tuple[int, ...]
    scale: Floats
    shift: Floats
    resolution: float = 1.0
    """Size of a difference that does not matter, in the series' unit."""

    @classmethod
    def of(
        cls, records: Sequence[Record], outputs: tuple[str, ...], measured: Sequence[Floats], size: Floats
    ) -> Layout:
        """Return the layout of measured outputs (rows, outputs) with the resolutions ``size`` (outputs,)."""
        rows, shift, top = tuple(record.rows_ for record in records), np.zeros(len(outputs)), 0.0
        if len(outputs) == 1:
            return cls(outputs, rows, np.ones(1), shift, float(size[0]))
        for k in range(len(outputs)):
            values = np.concatenate([own[:, k] for own in measured]) / size[k]
            low, high = float(np.nanmin(values)), float(np.nanmax(values))
            shift[k] = top - low
            top += 1.1 * (high - low)  # a tenth apart, so that no two ranges touch
        return cls(outputs, rows, size, shift)

    def stack(self, values: Sequence[Floats], *, between: float = np.nan, scaled: bool = True) -> Floats:
        """Return a series (n,) from one array (rows, outputs) per record; ``between`` is the value that separates."""
        pieces: list[Floats] = []
        for own in values:
            for k in range(len(self.outputs)):
                piece = own[:, k] / self.scale[k] + self.shift[k] if scaled else own[:, k]
                pieces += [piece, np.array([between])]
        return np.concatenate(pieces[:-1])

    def spread(self, values: Sequence[Floats]) -> Floats:
        """Return a series (n,) from an array (rows,) per record, equal for all outputs; the last value separates."""
        pieces = [np.append(own, own[-1]) for own in values for _ in self.outputs]
        return np.concatenate(pieces)[:-1]

    @cached_property
    def places(self) -> tuple[tuple[int, int, slice], ...]:
        """Record, output, and the slice of the engine's series that holds this output of this record."""
        found, begin = [], 0
        for record, rows in enumerate(self.rows):
            for output in range(len(self.outputs)):
                found.append((record, output, slice(begin, begin + rows)))
                begin += rows + 1
        return tuple(found)

    def native(self, values: Floats) -> list[Floats]:
        """Return engine values (n,) as (rows, outputs) per record in the outputs' units."""
        made = [np.empty((rows, len(self.outputs))) for rows in self.rows]
        for record, output, place in self.places:
            made[record][:, output] = (values[place] - self.shift[output]) * self.scale[output]
        return made


def observed_of(records: Sequence[Record], outputs: Sequence[str]) -> list[Floats]:
    """Return the measured outputs (rows, outputs) of every record; NaN where not measured."""
    made = [np.column_stack([column_of(record, name) for name in outputs]) for record in records]
    for k, name in enumerate(outputs):
        if not any(np.isfinite(own[:, k]).any() for own in made):
            raise InputError(f"'{name}' is measured nowhere", where=", ".join(r.label_ for r in records), do="fill it")
        values, do = np.concatenate([own[:, k] for own in made]), "leave it out of output"
        if np.isinf(values).any():
            raise InputError("is infinite somewhere", where=f"column '{name}'", do="leave such fields empty")
        if np.nanmin(values) == np.nanmax(values):
            raise InputError(
                "never changes: there is nothing to explain", where=f"column '{name}'", value=values[0], do=do
            )
    return made


def engine_time(times: Sequence[Floats], count: int) -> Floats:
    """Return the records' times (n,) one after the other, ``count`` times each, as a series that never decreases."""
    pieces: list[Floats] = []
    end = 0.0
    for own in times:
        step = float(np.median(np.diff(own)) or 1.0)
        for _ in range(count):
            pieces.append(np.append(own, own[-1] + step) - own[0] + end)
            end = float(pieces[-1][-1]) + step
    return np.concatenate(pieces)[:-1]


def per_output(wanted: PerOutput, records: Sequence[Record], outputs: Sequence[str], *, what: str) -> list[Floats]:
    """Return sizes given per output (a number, a column's name, or either by output) as (rows, outputs) per record.

    The arrays are NaN where nothing is given.
    """
    if isinstance(wanted, Mapping):
        unknown = sorted(set(wanted) - set(outputs))
        if unknown:
            raise InputError(f"is no output that {what} could belong to", where=unknown[0], limit=", ".join(outputs))
    made = [np.full((record.rows_, len(outputs)), np.nan) for record in records]
    for k, name in enumerate(outputs):
        one = wanted.get(name) if isinstance(wanted, Mapping) else wanted
        for record, own in zip(records, made, strict=True):
            if one is not None:
                own[:, k] = column_of(record, one) if isinstance(one, str) else float(one)
            if np.any(own[:, k] <= 0.0):
                value = float(np.nanmin(own[:, k]))
                raise InputError(f"{what} is not positive", where=f"{record.label_}, {name}", value=value)
    return made


def noise_of(observed: Sequence[Floats], output: int) -> float:
    """Return the noise of one reading of an output, estimated from its scatter; fast motion counts as noise, too."""
    pieces = [own[np.isfinite(own[:, output]), output] for own in observed]
    return scatter(*[piece for piece in pieces if len(piece) >= FEWEST])


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Noise of the readings: ``between`` neighbours by output, and ``sigma`` (rows, outputs), as given, else that.

    ``given`` says whether the noise of every reading was given.
    """

    between: list[float]
    sigma: list[Floats]
    given: bool

    @classmethod
    def of(cls, wanted: PerOutput, records: Sequence[Record], outputs: Sequence[str], measured: list[Floats]) -> Noise:
        """Return the noise of measured outputs (rows, outputs) of records, of which some may be given."""
        sizes = per_output(wanted, records, outputs, what="sigma")
        between = [noise_of(measured, k) for k in range(len(outputs))]
        sigma = [np.where(np.isfinite(own), own, between) for own in sizes]
        return cls(between, sigma, all(np.isfinite(own).all() for own in sizes))

    @property
    def usual(self) -> Floats:
        """The median noise of each output (outputs,)."""
        return np.asarray(np.nanmedian(np.concatenate(self.sigma), axis=0))


def resolutions(
    wanted: PerOutput, records: Sequence[Record], outputs: Sequence[str], measured: Sequence[Floats], noise: Noise
) -> Floats:
    """Return the resolution (outputs,): the one given, else a tenth of the noise."""
    known = per_output(wanted, records, outputs, what="resolution")[0][0]
    span = np.nanstd(np.concatenate(measured), axis=0)
    # With the usual number of samples an effect of a tenth of the noise just shows; a record without any noise is known
    # to the digits that it was written with.
    least = np.maximum.reduce([0.1 * noise.usual, 1e-5 * span, np.full(len(outputs), 1e-12)])
    return np.asarray(np.where(np.isfinite(known), known, least))


def blocks_of(
    wanted: int | str | Floats | Sequence[Floats] | None, records: Sequence[Record], times: Sequence[Floats]
) -> list[Ints]:
    """Return the block of every row, labels from 0 on that no two records share."""
    if wanted is None:
        # Of fewer than six, a held-out one is too large a part of the record; more are shorter than a model's memory.
        wanted = 1 if len(records) > 1 else 6
    if isinstance(wanted, np.ndarray) and wanted.ndim == 1:
        wanted = [wanted]
    if not isinstance(wanted, (str, int, np.integer)) and len(wanted) != len(records):
        raise InputError(
            "not every record has its blocks",
            where="blocks",
            value=f"{len(wanted)} arrays, {len(records)} records",
            do="give one array of numbers, one per row, for each record, or a column's name",
        )
    made: list[Ints] = []
    first = 0
    for k, (record, time) in enumerate(zip(records, times, strict=True)):
        if isinstance(wanted, (int, np.integer)):
            edges = np.linspace(time[0], time[-1], wanted + 1)[1:-1]
            labels = np.searchsorted(edges, time, side="right")
        else:
            column = column_of(record, wanted) if isinstance(wanted, str) else np.asarray(wanted[k], np.float64)
            if len(column) != record.rows_ or not np.isfinite(column).all():
                raise InputError(
                    "blocks are not known in every row",
                    where=f"{record.label_}, blocks",
                    value=f"{len(column)} values",
                    limit=f"{record.rows_}, all finite",
                    do="number every row",
                )
            labels = np.unique(column, return_inverse=True)[1]
        made.append(np.asarray(labels + first, np.int64))
        first += int(labels.max()) + 1
    return made


def check_blocks(block: Ints, valid: Flags) -> list[str]:
    """Return warnings about the blocks; a block that holds hardly any sample is refused."""
    labels, counts = np.unique(block[valid], return_counts=True)
    if counts.min() < FEWEST:
        raise InputError(
            f"block {labels[counts.argmin()]} holds hardly any sample",
            where="blocks",
            value=int(counts.min()),
            limit=f"{FEWEST} or more",
            do="take fewer and longer blocks",
        )
    if len(labels) == 1:
        return [
            "there is one block only: nothing is held out, and the answer rests on the evidence alone; give blocks=…"
        ]
    return []


def still(observed: Floats, noise: float) -> Flags:
    """Return the rows (rows,) in which an output stands still over 16 rows or more, to within its noise."""
    half = _STILL_ROWS // 2
    # Fewer rows cannot hold both a rest and a motion.
    if np.isfinite(observed).sum() < 2 * _STILL_ROWS:
        return np.zeros(len(observed), bool)
    filled = bridged(observed)
    before, after, _ = means_beside(filled, half)
    flag = np.abs(after - before) <= APART * noise / np.sqrt(half)
    kept = np.zeros(len(observed), bool)
    for begin, end in runs(flag):
        piece = filled[begin:end]
        # A slow creep does not show between neighbours, but over the whole stretch.
        calm = np.ptp(np.convolve(piece, np.ones(half) / half, mode="valid")) if len(piece) >= _STILL_ROWS else np.inf
        kept[begin:end] = calm <= BY_CHANCE * noise
    return kept
