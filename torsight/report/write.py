"""From the files of a run's folder to ``report.html``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from torsight.core.results import RunResults, read_results
from torsight.core.storage import write_text
from torsight.core.wording import verdict_sentence

if TYPE_CHECKING:
    import pandas as pd

    from torsight.report.figures import Figure

TEMPLATES: Final = Path(__file__).parent / "templates"


def write_report(folder: Path) -> Path:
    """Write ``report.html`` into a run's folder from whatever results are there.

    Parameters
    ----------
    folder : Path
        Holds any of ``angle.csv``, ``markers.csv``, ``track.json``, ``merged.csv``, ``sync.json``, ``fit.json``,
        ``discovery.json``, ``curves.csv`` and ``provenance.json``; a section whose files are missing is left out.

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
    results = read_results(folder)
    path = folder / "report.html"
    write_text(path, page(results))
    return path


def page(results: RunResults) -> str:
    """Return the text of the page."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("report.html").render(**contents(results)) + "\n"


def contents(results: RunResults) -> dict[str, Any]:
    """Return everything that the page shows, by the names that its template uses."""
    from torsight.report import sections
    from torsight.report.doubts import doubts

    return {
        "style": (TEMPLATES / "report.css").read_text(encoding="utf-8"),
        "name": results.folder.resolve().name,
        "headline": headline(results),
        "lead": sections.lead(results),
        "tiles": sections.tiles(results),
        "missing": sections.missing(results),
        "figures": _figures(results),
        "parameters": sections.parameter_table(results),
        "fit": sections.fit_lines(results),
        "tracking": sections.tracking(results),
        "clocks": sections.clocks(results),
        "unsure": doubts(results),
        "origin": sections.origin(results),
        "files": sections.files(results.folder),
    }


def headline(results: RunResults) -> str:
    """Return the first sentence of the page: the verdict, or what was measured where there is none yet."""
    if results.discovery is not None:
        return verdict_sentence(results.discovery)
    if results.fit is not None:
        return "The plain model was fitted; what it lacks was not asked yet."
    if results.merged is not None or results.angle is not None:
        return "The motion was measured; no model was fitted yet."
    return "Nothing was measured yet."


def _figures(results: RunResults) -> dict[str, list[Figure]]:
    """Return the figures by the section that they stand in; a section without any is absent."""
    found: dict[str, list[Figure | None]] = {}
    if results.curves is not None:
        floor = (results.discovery or {}).get("noise_floor_deg")
        found |= _model_figures(results.curves, floor)
    elif results.merged is not None:
        from torsight.report import figures

        table = results.merged
        loops = [figures.angle_over_temperature(table, spring) for spring in ("a", "b")]
        found |= {
            "time": [figures.angle_over_time(table)],
            "loops": loops,
            "temperatures": [figures.temperatures_over_time(table)],
        }
    elif results.angle is not None:
        from torsight.report import figures

        found["time"] = [figures.angle_over_time(results.angle)]
    if results.angle is not None:
        from torsight.report import figures

        found["sigma"] = [figures.sigma_over_time(results.angle)]
    if results.markers is not None:
        from torsight.report import figures

        found["markers"] = [figures.marker_paths(results.markers)]
    kept = {name: [figure for figure in some if figure is not None] for name, some in found.items()}
    return {name: some for name, some in kept.items() if some}


def _model_figures(curves: pd.DataFrame, floor_deg: float | None) -> dict[str, list[Figure | None]]:
    from torsight.report import figures

    against = [
        figures.residual_against(curves, name, values) for name, values in figures.driver_columns(curves).items()
    ]
    direction = figures.residual_by_group(curves, "direction", "By direction", "direction")
    return {
        "time": [figures.angle_over_time(curves)],
        "loops": [figures.angle_over_temperature(curves, spring) for spring in ("a", "b")],
        "temperatures": [figures.temperatures_over_time(curves)],
        "residual": [figures.residual_over_time(curves), figures.residual_left(curves, floor_deg)],
        "against": [*against, direction],
        "cycles": [figures.residual_by_group(curves, "half_cycle", "By half-cycle", "half-cycle")],
    }
