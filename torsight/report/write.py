"""From the files of a run's folder to ``report.html``."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import jinja2
import numpy as np
import pandas as pd

from torsight.core.files.paths import AnyPath
from torsight.core.files.results import RunResults, column, read_results
from torsight.core.files.storage import write_table, write_text
from torsight.core.progress import Progress, silent
from torsight.core.words.colours import DARK, LIGHT
from torsight.core.words.wording import is_plain_answer, unexplained, verdict_sentence
from torsight.discovery.measured_law import read_laws
from torsight.report.figures import evidence, measured, motion, planned, residuals
from torsight.report.figures.law_plots import law_figure
from torsight.report.figures.motion import Figure
from torsight.report.plots.formulas import with_symbols
from torsight.report.plots.interactive import drawing, library
from torsight.report.plots.still import picture_data, still
from torsight.report.sections import page_content, parameter_table
from torsight.report.sections.limitations import doubts
from torsight.report.sections.next_steps import next_steps
from torsight.report.sections.parameter_table import priors

TEMPLATES: Final = Path(__file__).parent / "templates"
PAPER: Final = {**LIGHT, "card": "#ffffff", "ink": "#000000", "muted": "#444444", "rule": "#bbbbbb"}
FOLDER: Final = "figures"
NAMES: Final = frozenset(
    {"before_after", "candidates", "unseen_half_cycles", "next_experiment", "pulls", "angle_time", "temperatures"}
    | {"angle_temperature_a", "angle_temperature_b", "angle_sigma", "both_clocks", "markers", "residual_left"}
    | {f"residual_{name}" for name in (*residuals.LABELS, "direction", "half_cycle")}
)
"""Names of all figures that a report may hold, except the laws; only files with these names are ever removed."""


def write_report(folder: AnyPath, *, progress: Progress = silent) -> Path:
    """Write ``report.html`` into a run's folder from the results that exist there.

    Parameters
    ----------
    folder : path
        Holds any of ``angle.csv``, ``markers.csv``, ``track.json``, ``track.png``, ``merged.csv``, ``sync.json``,
        ``fit.json``, ``discovery.json``, ``curves.csv`` and ``provenance.json``; a section whose files are missing is
        left out.
    progress : Progress
        Called with the part of the page that is drawn.

    The page draws its plots with zoom and values under the pointer; on paper, and where scripts are off, it shows them
    as pictures. Beside the page every figure is written as ``figures/NAME.svg``, and as ``figures/NAME.csv`` where no
    other table holds its numbers.

    Returns
    -------
    Path
        The page. It needs no other file and no network.

    Raises
    ------
    InputError
        When the folder is missing, empty, or a file in it is damaged.
    OutputError
        When the page cannot be written.
    """
    folder = Path(folder)
    progress("report", 0, _PARTS)
    results = read_results(folder)
    path = write_page(folder, contents(results, progress=progress))
    progress("report", _PARTS, _PARTS)
    return path


def write_page(
    folder: Path, shown: Mapping[str, Any], *, template: str = "report.html", ours: Callable[[str], bool] | None = None
) -> Path:
    """Write ``report.html`` with some :func:`contents`, and its figures; for ``ours`` see :func:`write_figures`."""
    figures = [figure for some in shown["figures"].values() for figure in some]
    pictures = {figure.name: still(figure.panels) for figure in figures}
    write_figures(folder, figures, pictures, ours=ours or NAMES.__contains__)
    drawn = drawing({figure.name: figure.panels for figure in figures}) if figures else ""
    path = folder / "report.html"
    write_text(path, page(shown, pictures=pictures, drawn=drawn, template=template))
    return path


def write_figures(
    folder: Path,
    figures: Iterable[Figure],
    pictures: Mapping[str, str],
    *,
    ours: Callable[[str], bool] = NAMES.__contains__,
) -> None:
    """Write ``figures/NAME.svg``, and ``figures/NAME.csv`` for numbers that no other table holds.

    ``pictures`` holds each figure's SVG by its name. Files of figures that an earlier page showed and this page does
    not are removed where ``ours`` is true for their names; other files are kept.
    """
    target = folder / FOLDER
    written = set()
    for figure in figures:
        write_text(target / f"{figure.name}.svg", pictures[figure.name] + "\n")
        written.add(f"{figure.name}.svg")
        if figure.data is not None:
            write_table(target / f"{figure.name}.csv", figure.data)
            written.add(f"{figure.name}.csv")
    for path in [*target.glob("*.svg"), *target.glob("*.csv")]:
        if path.name not in written and ours(path.stem):
            path.unlink(missing_ok=True)


def data_link(figure: Figure) -> str:
    """Return the path of a figure's numbers, relative to the page; empty where they are not written."""
    return f"{FOLDER}/{figure.name}.csv" if figure.data is not None else figure.source


def page(
    shown: Mapping[str, Any],
    *,
    pictures: Mapping[str, str] = MappingProxyType({}),
    drawn: str = "",
    template: str = "report.html",
) -> str:
    """Return the text of the page that shows some :func:`contents`.

    ``pictures`` are the figures' SVG by name (a page without them holds text only); ``drawn`` are the same figures for
    a browser with scripts.
    """
    return from_template(
        template,
        shown,
        pictures={name: picture_data(svg) for name, svg in pictures.items()},
        drawn=drawn,
        at_night=json.dumps(at_night()),
        bokeh=library() if drawn else "",
        draw=(TEMPLATES / "draw.js").read_text(encoding="utf-8"),
        data_link=data_link,
        figure_folder=FOLDER,
        colour_name={value: name for name, value in LIGHT.items()}.__getitem__,
    )


def from_template(name: str, shown: Mapping[str, Any], **more: Any) -> str:
    """Return the text of a page: a filled template in the style of all pages."""
    style = style_variables() + (TEMPLATES / "report.css").read_text(encoding="utf-8")
    return _templates().get_template(name).render(**shown, **more, style=style) + "\n"


def style_variables() -> str:
    """Return the colours as variables of a style sheet."""
    return (
        f":root {{ color-scheme: light dark; {_variables(LIGHT)} }}\n"
        f"@media (prefers-color-scheme: dark) {{ :root {{ {_variables(DARK)} }} }}\n"
        f"@media print {{ :root {{ color-scheme: light; {_variables(PAPER)} }} }}\n"
    )


def at_night() -> dict[str, str]:
    """Return the dark screen's colour for each one of the light screen."""
    return {LIGHT[name]: DARK[name] for name in LIGHT}


def _variables(colours: dict[str, str]) -> str:
    return " ".join(f"--{name}: {value};" for name, value in colours.items())


@functools.cache
def _templates() -> jinja2.Environment:
    """Return the templates; each is compiled once per process."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )


def contents(results: RunResults, *, progress: Progress = silent) -> dict[str, Any]:
    """Return the content of the page, by the names that its template uses."""
    title = headline(results)
    shown: dict[str, Any] = {
        "name": results.folder.resolve().name,
        "title": title,
        "headline": with_symbols(title),
        "lead": page_content.lead(results),
        "tiles": page_content.tiles(results),
        "facts": page_content.facts(results),
        "next_steps": next_steps(results),
        "missing": page_content.missing(results),
        "figures": _figures(results, progress=progress),
        "parameters": parameter_table.parameter_table(results),
        "fit": parameter_table.fit_lines(results),
        "tracking": page_content.tracking(results),
        "track_picture": page_content.track_picture(results),
        "clocks": page_content.clocks(results),
        "unsure": doubts(results),
        "origin": page_content.origin(results),
        "files": page_content.files(results.folder),
    }
    return shown | {"parts": _parts(shown)}


def _parts(shown: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the sections of the page, each with its anchor, for the table of contents."""
    figures = shown["figures"]
    there = {
        "next": ("What to do next", shown["next_steps"]),
        "missing": ("What was missing", shown["missing"]),
        "laws": ("Laws", figures.get("laws")),
        "experiment": ("Next experiment", shown["missing"].get("next") or figures.get("next")),
        "residual": ("Residual", figures.get("residual") or figures.get("against")),
        "parameters": ("Parameters", shown["parameters"]["rows"]),
        "motion": ("Motion", any(figures.get(name) for name in ("time", "loops", "temperatures"))),
        "unsure": ("Not sure", shown["unsure"]),
        "tracking": ("Tracking", figures.get("sigma") or figures.get("markers") or shown["track_picture"]),
        "clocks": ("Clocks", shown["clocks"]),
        "origin": ("Origin", shown["origin"] or shown["files"]),
    }
    return [(name, words) for name, (words, found) in there.items() if found]


def headline(results: RunResults) -> str:
    """Return the first sentence of the page: the verdict, or the measured motion where there is no verdict yet."""
    if results.discovery is not None:
        return verdict_sentence(results.discovery)
    if results.fit is not None:
        ratio = (results.fit.get("residual") or {}).get("variance_ratio")
        doubt = unexplained(math.sqrt(ratio)) if ratio is not None else ""
        return f"{doubt} The plain model was fitted; discovery has not run yet.".strip()
    if results.merged is not None or results.angle is not None:
        return "The motion was measured; no model was fitted yet."
    return "Nothing was measured yet."


def _figures(results: RunResults, *, progress: Progress) -> dict[str, list[Figure]]:
    """Return the figures by section; a section without figures is absent."""
    found: dict[str, list[Figure | None]] = {}
    for number, part in enumerate(_GROUPS, 1):
        found |= part(results)
        progress("report", number, _PARTS)
    kept = {name: [figure for figure in some if figure is not None] for name, some in found.items()}
    if kept.get("unseen"):
        # Errors on held-out half-cycles are more informative than those of the fit itself.
        kept.pop("cycles", None)
    return {name: some for name, some in kept.items() if some}


def _motion(results: RunResults) -> dict[str, list[Figure | None]]:
    """Return the figures of the motion and of the residual, from the most complete table of the run."""
    for table, source in ((results.curves, "curves.csv"), (results.merged, "merged.csv")):
        if table is None or not drawable(table):
            continue
        found: dict[str, list[Figure | None]] = {
            "time": [motion.angle_over_time(table, source=source)],
            "loops": [motion.angle_over_temperature(table, spring, source=source) for spring in ("a", "b")],
            "temperatures": [motion.temperatures_over_time(table, source=source)],
        }
        if source == "curves.csv":
            found |= _residual(table, (results.discovery or {}).get("noise_floor_deg"))
        return found
    return {}


def _residual(curves: pd.DataFrame, floor_deg: float | None) -> dict[str, list[Figure | None]]:
    against = [
        residuals.residual_against(curves, name, values) for name, values in residuals.driver_columns(curves).items()
    ]
    return {
        "hero": [evidence.before_and_after(curves, floor_deg)],
        "residual": [residuals.residual_left(curves, floor_deg)],
        "against": [*against, residuals.by_group(curves, "direction", width=370.0, height=240.0)],
        "cycles": [residuals.by_group(curves, "half_cycle", width=860.0, height=200.0)],
    }


def _measurement(results: RunResults) -> dict[str, list[Figure | None]]:
    found: dict[str, list[Figure | None]] = {}
    if results.angle is not None and drawable(results.angle):
        events = (results.track or {}).get("events") or []
        found["sigma"] = [measured.angle_and_sigma(results.angle, events)]
    if results.sync is not None and results.merged is not None and drawable(results.merged):
        found["clocks"] = [measured.both_clocks(results.merged)]
    if results.markers is not None:
        found["markers"] = [measured.marker_paths(results.markers)]
    return found


def _answer(results: RunResults) -> dict[str, list[Figure | None]]:
    """Return the figures of the answer: candidates, held-out half-cycles, pulls, the next experiment."""
    discovery = results.discovery or {}
    plain = discovery.get("plain_parameters") or (results.fit or {}).get("parameters") or {}
    after = discovery.get("parameters") or {}
    extended = bool(after) and not is_plain_answer(discovery)
    found: dict[str, list[Figure | None]] = {
        "candidates": [evidence.candidates(discovery)],
        "unseen": [evidence.unseen_half_cycles(discovery)],
        "pulls": [evidence.pulls(priors(results), plain, after, extended=extended)],
    }
    if results.next_experiment is not None and discovery.get("verdict") == "ambiguous":
        found["next"] = [planned.programme(results.next_experiment)]
    return found


def _laws(results: RunResults) -> dict[str, list[Figure | None]]:
    """Return the measured laws, where there are any."""
    if not (results.discovery or {}).get("laws"):
        return {}
    return {"laws": [law_figure(law) for law in read_laws(results.folder, results.discovery or {})]}


_GROUPS: Final = (_motion, _measurement, _answer, _laws)
_PARTS: Final = len(("reading", *_GROUPS, "writing"))
"""Steps of ``progress``."""


def drawable(table: pd.DataFrame) -> bool:
    """Return whether a table holds enough known times and angles to be drawn."""
    return (
        len(table) > 1
        and bool(np.isfinite(column(table, "time_s")).all())
        and bool(np.isfinite(column(table, "angle_deg")).any())
    )
