"""``torsight doctor``: what will limit the result, before the long run."""

from __future__ import annotations

from typing import Annotated

from typer import Argument

from torsight.cli.answer import Answer
from torsight.cli.checkup.finding import Finding, exit_code, ordered, verdict
from torsight.cli.checkup.install import check_install
from torsight.cli.console import progress_bar, say
from torsight.cli.options import Columns, Fps, Units, said


def doctor(
    inputs: Annotated[
        list[str],
        Argument(
            metavar="EXPERIMENT.toml|FILES…",
            help="An experiment, or any of: film, TEMPS.csv, ACTUATOR.toml, CAMERA.toml, MARKERS.toml.",
        ),
    ],
    *,
    fps: Fps = None,
    columns: Columns = None,
    units: Units = None,
) -> Answer:
    """Check all inputs and say what will limit the result.

    A stretch of the film is tracked, and the log drives the model. The verdict is good, usable or do again, followed by
    the reasons, the strongest limitation first. With do again the exit code is that with which a run would end.

    Example: torsight doctor experiment.toml
    """
    from torsight.cli.checkup.examine import examine, inputs_of

    chosen = inputs_of(inputs, fps=fps)
    if columns is not None or units is not None:
        named = said(columns, units)
        chosen.columns, chosen.units = named["columns"], named["units"]
    with progress_bar() as progress:
        findings, content = examine(chosen, progress=progress)
    findings = ordered([*findings, *check_install()])
    say(*verdict_lines(findings))
    result = {"verdict": verdict(findings), "findings": [item.to_json() for item in findings], **content}
    return Answer(result, exit_code=exit_code(findings))


def verdict_lines(findings: list[Finding]) -> list[str]:
    """Return the verdict and its reasons as lines for the terminal."""
    lines = [f"Verdict           {verdict(findings)}"]
    for item in findings:
        lines.append(f"{item.level:<10}{item.about:<14}{item.text}")
        if item.do:
            lines.append(f"{'':<24}do: {item.do}")
    return lines
