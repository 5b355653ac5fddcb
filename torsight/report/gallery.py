"""``index.html`` of a campaign: one small picture per experiment, each a link to its report."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from torsight.core.errors import TorsightError
from torsight.core.files.results import RunResults, column, read_results
from torsight.core.files.storage import write_text
from torsight.core.words.wording import estimate, verdict_sentence
from torsight.report.figures.motion import ANGLE, RESIDUAL, TIME
from torsight.report.plots.panels import Axis, Panel
from torsight.report.plots.still import picture_data, still
from torsight.report.write import from_template


def write_gallery(rows: Sequence[Mapping[str, Any]], out: Path) -> Path:
    """Write ``index.html``: angle and residual of every experiment, small, in the order of the rows of the results.

    The page needs the experiments' folders only for its links.
    """
    done = sum(row["status"] == "done" for row in rows)
    shown = {"name": out.resolve().name, "cards": [_card(row, out) for row in rows], "done": done}
    path = out / "index.html"
    write_text(path, from_template("gallery.html", shown))
    return path


def _card(row: Mapping[str, Any], out: Path) -> dict[str, Any]:
    folder = Path(row["folder"])
    card: dict[str, Any] = {"name": row["name"], "message": row["message"], "pictures": [], "link": None, "lines": []}
    if row["status"] != "done":
        return card
    try:
        results = read_results(folder)
        card |= {"pictures": _pictures(results), "lines": _lines(results)}
    except TorsightError as error:
        return card | {"message": str(error)}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        # A file that was changed by hand: its own card says so, the others are not affected.
        return card | {"message": f"its results are damaged ({type(error).__name__}: {error})"}
    return card | {"link": os.path.relpath(folder / "report.html", out)}


def _lines(results: RunResults) -> list[str]:
    if results.discovery is None:
        return []
    friction = results.discovery["parameters"].get("tau_c_mnm")
    torque = [] if friction is None else [f"friction torque {estimate(friction)}"]
    return [verdict_sentence(results.discovery), *torque]


def _pictures(results: RunResults) -> list[tuple[str, str]]:
    """Return the small pictures of one experiment: for each its description and a data URL."""
    if results.curves is None:
        return []
    time_s = column(results.curves, "time_s")
    span = Axis.along(TIME, time_s)
    angle, plain = column(results.curves, "angle_deg"), column(results.curves, "plain_deg")
    motion = Panel(span, Axis.around(ANGLE, angle), width=380, height=170)
    motion.line(time_s, angle, "measured", label="measured")
    motion.line(time_s, plain, "before", label="plain model")
    before, after = (column(results.curves, f"residual_{name}_deg") for name in ("before", "after"))
    left = Panel(span, Axis.around(RESIDUAL, before, after), width=380, height=170)
    left.line(time_s, before, "before", label="plain")
    left.line(time_s, after, "after", label="extended")
    return [("Angle", picture_data(still([motion]))), ("Residual", picture_data(still([left])))]
