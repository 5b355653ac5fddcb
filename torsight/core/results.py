"""What a run left in its folder, read back: tables and JSON, each only where it is there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from torsight.core.errors import InputError
from torsight.core.storage import read_json, read_table

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


@dataclass(frozen=True, slots=True, eq=False)
class RunResults:
    """The files of one run's folder; None where a file is missing.

    Attributes
    ----------
    folder : Path
        Where they lie.
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
    track: dict[str, Any] | None = None
    sync: dict[str, Any] | None = None
    fit: dict[str, Any] | None = None
    discovery: dict[str, Any] | None = None
    model: dict[str, Any] | None = None
    provenance: dict[str, Any] | None = None


def read_results(folder: Path) -> RunResults:
    """Read whatever a run left in ``folder``.

    Raises
    ------
    InputError
        When the folder is missing, holds none of the files, or one of them is damaged.
    """
    if not folder.is_dir():
        raise InputError("no such folder", where=str(folder), do="name the folder that 'torsight run --out' filled")
    tables = {
        name: read_table(folder / f"{name}.csv", required=columns)
        for name, columns in TABLES.items()
        if (folder / f"{name}.csv").exists()
    }
    documents = {name: read_json(folder / f"{name}.json") for name in DOCUMENTS if (folder / f"{name}.json").exists()}
    if not tables and not documents:
        raise InputError(
            "holds no results",
            where=str(folder),
            limit=", ".join([f"{name}.csv" for name in TABLES] + [f"{name}.json" for name in DOCUMENTS]),
            do="name the folder that 'torsight run --out' filled",
        )
    return RunResults(
        folder=folder,
        angle=tables.get("angle"),
        markers=tables.get("markers"),
        merged=tables.get("merged"),
        curves=tables.get("curves"),
        next_experiment=tables.get("next_experiment"),
        track=documents.get("track"),
        sync=documents.get("sync"),
        fit=documents.get("fit"),
        discovery=documents.get("discovery"),
        model=documents.get("model"),
        provenance=documents.get("provenance"),
    )
