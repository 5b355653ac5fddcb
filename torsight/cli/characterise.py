"""``torsight characterise``: a spring's values from its four tests."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import progress_bar, say
from torsight.core.files.paths import require_apart
from torsight.core.files.storage import write_json, write_text


def characterise(
    tests: Annotated[Path, Argument(metavar="TESTS.toml", help="Geometry and the logs of the four tests.")],
    *,
    out: Annotated[Path, Option(metavar="DIR", help="Folder for the results.")],
) -> Answer:
    """Make an actuator.toml from a spring's four tests.

    Uncertainties, characterisation.json and figures are made, too. TESTS.toml: [spring] wire_diameter_mm,
    wire_length_mm, lever_mm; [[free_recovery]] file (temp_c, angle_deg), pre_deformation_deg; [[force_angle]] file
    (angle_deg, force_n), range "small" or "large", from_deg, to_deg; [block] file (temp_c, force_n),
    pre_deformation_deg; [assembly] theta_p_deg; [friction] tau_c_mnm.

    Example: torsight characterise tests.toml --out spring
    """
    import tomli_w

    from torsight.actuator.characterising.characterisation import characterise as fit_tests
    from torsight.actuator.characterising.characterised import characterisation_figures
    from torsight.actuator.characterising.spring_tests import read_tests

    made = (out / "actuator.toml", out / "characterisation.json")
    require_apart(made, [tests])
    read = read_tests(tests)
    require_apart(made, [Path(name) for name in read.sources])
    with progress_bar() as progress:
        found = fit_tests(read, source=str(tests), progress=progress)
    figures = characterisation_figures(out, found)
    write_text(out / "actuator.toml", "# Made by 'torsight characterise'.\n" + tomli_w.dumps(found.spec.to_tables()))
    content = {**found.to_json(), "figures": [path.name for path in figures]}
    write_json(out / "characterisation.json", content)
    rmse = {
        law: found.steps[name].rmse
        for law, name in (("Liang-Rogers", "free_recovery"), ("Tanaka", "free_recovery_tanaka"))
    }
    say("free recovery: " + ", ".join(f"{law} {error:.2f}°" for law, error in rmse.items()))
    for name, estimate in found.estimates.items():
        low, high = estimate.ci95
        say(f"  {name:14s} {estimate.value:8.3f}   95 %: {low:.3f} to {high:.3f} {estimate.unit}")
    return Answer(content, files=(out / "actuator.toml", out / "characterisation.json", *figures))
