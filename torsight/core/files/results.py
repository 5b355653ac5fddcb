"""The results in a run's folder, read back: tables and JSON files as far as they exist."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from torsight.core.errors import InputError
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import read_json, read_table
from torsight.core.frozen import Frozen
from torsight.core.units import Flags, Floats
from torsight.core.words.shown import Shown, draw_models
from torsight.core.words.wording import estimate, verdict_sentence

if TYPE_CHECKING:
    import pandas as pd

TABLES: Final = {
    "angle": ("time_s", "angle_deg", "angle_sigma_deg", "valid"),
    "markers": ("time_s",),
    "merged": ("time_s", "angle_deg", "temp_a_c", "temp_b_c"),
    "curves": ("time_s", "angle_deg", "plain_deg", "temp_a_c", "temp_b_c"),
    "next_experiment": ("time_s", "temp_a_c", "temp_b_c"),
}
"""Tables of a run's folder and the columns that must hold numbers."""

DOCUMENTS: Final = ("track", "sync", "fit", "discovery", "model", "provenance")
"""JSON files of a run's folder."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RunResults(Frozen, Shown):
    """The files of one run's folder; None where a file is missing.

    Attributes
    ----------
    folder : Path
        Folder of the files.
    angle, markers, merged, curves, next_experiment : pandas.DataFrame or None
        ``angle.csv``, ``markers.csv``, ``merged.csv``, ``curves.csv``, ``next_experiment.csv``; degrees and
        °C, as in the files.
    track, sync, fit, discovery, model, provenance : dict or None
        The JSON files of these names.
    """

    folder: Path
    angle: pd.DataFrame | None = None
    markers: pd.DataFrame | None = None
    merged: pd.DataFrame | None = None
    curves: pd.DataFrame | None = None
    next_experiment: pd.DataFrame | None = None
    track: Mapping[str, Any] | None = None
    sync: Mapping[str, Any] | None = None
    fit: Mapping[str, Any] | None = None
    discovery: Mapping[str, Any] | None = None
    model: Mapping[str, Any] | None = None
    provenance: Mapping[str, Any] | None = None

    def facts(self) -> dict[str, str]:
        """Return the folder, its files, the friction torque of the best model and the verdict of discovery."""
        names = [name for name in (*TABLES, *DOCUMENTS) if getattr(self, name) is not None]
        facts = {"folder": str(self.folder), "holds": ", ".join(names)}
        if "tau_c_mnm" in (parameters := self.parameters()):
            facts["friction torque"] = estimate(parameters["tau_c_mnm"])
        if self.discovery is not None:
            facts["discovery"] = verdict_sentence(self.discovery)
        return facts

    def measured_angle_deg(self) -> Floats:
        """Return the known measured angles, degrees."""
        table = self.first_of("angle", "merged", "curves")
        if table is None:
            return np.empty(0)
        values = column(table, "angle_deg")
        known = np.isfinite(values) & (column(table, "valid") > 0.5 if "valid" in table.columns else True)
        return np.asarray(values[known])

    def measured_frames(self) -> Flags:
        """Return the mask (n,) of the frames in which the angle is known; empty without ``angle.csv``."""
        return np.empty(0, np.bool_) if self.angle is None else column(self.angle, "valid") > 0.5

    def parameters(self) -> Mapping[str, Any]:
        """Return the parameters of discovery, else of the plain fit."""
        documents = (document or {} for document in (self.discovery, self.fit))
        return next((document["parameters"] for document in documents if document.get("parameters")), {})

    def first_of(self, *names: str, holding: str = "time_s") -> pd.DataFrame | None:
        """Return the first of the named tables that exists and has the column ``holding``; None without one."""
        tables = (getattr(self, name) for name in names)
        return next((table for table in tables if table is not None and holding in table.columns), None)

    def _columns(self) -> dict[str, Any]:
        """Return the columns of the first existing table of ``curves.csv``, ``merged.csv`` and ``angle.csv``."""
        table = self.first_of("curves", "merged", "angle")
        return {"time_s": []} if table is None else {str(name): table[name].to_numpy() for name in table.columns}

    def _draw(self, axes: Any) -> None:
        draw_models(axes, self._columns())


def column(table: pd.DataFrame, name: str) -> Floats:
    """Return a column as float64 (NaN throughout where it is absent)."""
    if name not in table.columns:
        return np.full(len(table), np.nan)
    return np.asarray(table[name].to_numpy(dtype=np.float64))


def read_results(folder: AnyPath) -> RunResults:
    """Read the results of a run in ``folder``.

    Raises InputError when the folder is missing, holds none of the files, or one of them is damaged.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError("no such folder", where=str(folder), do="name the folder that 'torsight run --out' filled")
    found: dict[str, Any] = {
        name: read_table(folder / f"{name}.csv", required=columns)
        for name, columns in TABLES.items()
        if (folder / f"{name}.csv").exists()
    }
    found |= {name: read_json(folder / f"{name}.json") for name in DOCUMENTS if (folder / f"{name}.json").exists()}
    if not found:
        raise InputError(
            "holds no results",
            where=str(folder),
            limit=", ".join([f"{name}.csv" for name in TABLES] + [f"{name}.json" for name in DOCUMENTS]),
            do="name the folder that 'torsight run --out' filled",
        )
    return RunResults(folder, **found)
