"""``torsight fit``: friction torque and characterised values from a merged record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import progress_bar, say
from torsight.cli.options import ActuatorFile
from torsight.core.errors import NoResultError, TorsightError
from torsight.core.files.paths import require_apart
from torsight.core.files.storage import write_json
from torsight.core.files.tables import read_merged
from torsight.core.progress import Progress, silent
from torsight.core.words.wording import case_words, listed

if TYPE_CHECKING:
    from torsight.actuator.fit_result import FitResult


def _effect_ids(begun: str) -> list[str]:
    """Return the effects' ids for a shell's completion, from their file names, so that nothing need be imported."""
    folder = Path(__file__).parents[1] / "actuator" / "effects"
    return sorted(path.stem for path in folder.glob(f"{begun}*.py") if not path.stem.startswith("_"))


def fit(
    merged: Annotated[Path, Argument(metavar="MERGED.csv", help="Angle and temperatures on one clock.")],
    *,
    actuator: ActuatorFile,
    out: Annotated[Path, Option(metavar="DIR", help="Folder for fit.json and model.json.")],
    effect: Annotated[
        list[str] | None,
        Option(metavar="ID", autocompletion=_effect_ids, help="An effect to fit as well; may be given more than once."),
    ] = None,
) -> Answer:
    """Fit friction torque and characterised values to a record.

    The uncertainties of the characterised values are priors. Ends with exit code 4 where the fitted model is no
    better than a constant angle; its files are written all the same.

    Example: torsight fit out/merged.csv --actuator actuator.toml --out out
    """
    from torsight.actuator.quantities import in_symbols

    held = _held(out / "model.json")
    with progress_bar() as progress:
        result = fit_to_folder(merged, actuator, out=out, effects=tuple(effect or ()), progress=progress)
    tau = result.estimates["tau_c_mnm"]
    say(
        f"friction torque {tau.value:.3f} mN·m (95 %: {tau.ci95[0]:.3f} to {tau.ci95[1]:.3f}), "
        f"error {result.rmse_deg:.2f}°, {case_words(result.cycle.case)}"
    )
    if lost := [name for name in held if name not in result.model.effects]:
        say(
            f"note: {out / 'model.json'} held a model with {listed(lost)}; it now holds this fit's, which 'torsight "
            "predict' will use: for the other one discover again, and fit into another --out folder"
        )
    for doubt in result.attention:
        say(f"attention: {in_symbols(doubt)}")
    code = NoResultError.exit_code if result.explains_nothing else 0
    return Answer(result.to_json(), files=(out / "fit.json", out / "model.json"), exit_code=code)


def _held(path: Path) -> list[str]:
    """Return the effects and laws of a model file without those that every fit has; [] where there is no model."""
    from torsight.actuator.effects import always_fitted
    from torsight.actuator.fitted import read_model

    try:
        model = read_model(path).model
    except TorsightError:
        return []
    own = [effect.id for effect in model.chosen if effect not in always_fitted() and not effect.is_clock]
    return [*own, *(f"the law {form.id}" for form in model.laws)]


def fit_to_folder(
    merged: Path, actuator: Path, *, out: Path, effects: tuple[str, ...] = (), progress: Progress = silent
) -> FitResult:
    """Fit a merged record, write ``fit.json`` and ``model.json``, and report a fit that explains nothing."""
    from torsight.actuator.fit_result import nothing_explained, turns
    from torsight.actuator.fitted import fitted_model, write_model
    from torsight.actuator.model import ActuatorModel
    from torsight.actuator.spec import read_actuator
    from torsight.core.files.lock import only_writer
    from torsight.discovery.model_fit import fit_model

    require_apart([out / "fit.json", out / "model.json"], [merged, actuator])
    model = ActuatorModel(read_actuator(actuator), effects)
    drive = model.prepare(read_merged(merged), where=str(merged))
    with only_writer(out):
        result = fit_model(model, drive, progress=progress, where=str(merged))
        write_json(out / "fit.json", result.to_json())
        account = {"rmse_deg": result.rmse_deg, "r2": result.r2, "made_by": "torsight fit"}
        fitted = fitted_model(result.model, result.values, drive, account=account, doubt=result.doubt)
        write_model(out / "model.json", fitted)
    if result.explains_nothing:
        what = "the fitted model is no better than a constant angle"
        say(f"torsight: {nothing_explained(what, result.r2, where=str(merged), more=f': {turns(result)}')}")
    return result
