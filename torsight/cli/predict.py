"""``torsight predict``: a fitted or extended model's angles for a later temperature log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import progress_bar, say
from torsight.cli.options import Columns, Units, said
from torsight.core.errors import ConfigError
from torsight.core.files.paths import require_apart
from torsight.core.files.storage import write_table
from torsight.core.units import DEG

if TYPE_CHECKING:
    from torsight.actuator.effects import Effect
    from torsight.actuator.model import ActuatorModel


def predict(
    model: Annotated[Path, Argument(metavar="MODEL.json", help="Model of 'torsight fit', 'discover' or 'missing'.")],
    temperature: Annotated[
        Path, Argument(metavar="RECORD.csv", help="Temperatures of both springs; or a record of one's own model.")
    ],
    *,
    start_angle: Annotated[
        float | None, Option(metavar="DEG", help="Measured angle at the first row, degrees (actuator only).")
    ] = None,
    initial: Annotated[
        list[str] | None,
        Option(metavar="NAME=VALUE", help="Initial state of the record (own models only); may be repeated."),
    ] = None,
    out: Annotated[Path, Option(metavar="FILE.csv", help="Table to write (.csv or .parquet).")],
    columns: Columns = None,
    units: Units = None,
) -> Answer:
    """Predict a fitted model's angles for a later temperature log.

    Every instant of the log, on the log's clock, has an angle and its standard deviation. The model of 'torsight
    missing' predicts its outputs for another record in the same way, without --start-angle. The initial state of
    the record is fitted to its first rows where they hold the outputs; else give it with --initial.

    Example: torsight predict out/model.json later_temps.csv --start-angle 177.6 --out predicted.csv
    """
    from torsight.discovery.own.answer.saved import is_own_model

    is_own = is_own_model(model)
    useless = (
        {"--start-angle": start_angle, "--columns": columns, "--units": units} if is_own else {"--initial": initial}
    )
    for option in (name for name, value in useless.items() if value is not None):
        kind = "a model of one's own" if is_own else "the actuator's model"
        raise ConfigError(f"{kind} has no use for it", where=f"{model}, {option}", do="leave it out")
    if is_own:
        return _predict_own(model, temperature, initial=initial or [], out=out)
    if start_angle is None:
        raise ConfigError("the actuator's model needs it", where="--start-angle", do="give the angle at the first row")
    from torsight.actuator.fitted import read_model
    from torsight.actuator.record.logs import read_log
    from torsight.cli.simulate import write_angles_of
    from torsight.discovery.prediction import predict_with_sigma

    require_apart([out], [model, temperature])
    fitted = read_model(model)
    log = read_log(temperature, **said(columns, units), tell=lambda words: say(f"note: {words}"))
    with progress_bar() as progress:
        found = predict_with_sigma(
            fitted, log, start_angle_rad=start_angle * DEG, where=str(temperature), progress=progress
        )
    alternatives = [(other.model, share) for other, share in fitted.alternatives()]
    always = _in_all([fitted.model, *(model for model, _ in alternatives)])
    own = _acting(fitted.model, always)
    # An effect and the law of which it is a form are the same explanation to people.
    others = [
        (acting, share) for other, share in alternatives if (acting := _acting(other, always)).keys() ^ own.keys()
    ]
    others.sort(key=lambda other: -other[1])
    if others:
        named = [f"{_named(acting)} ({100.0 * share:.0f} %)" for acting, share in others]
        more = len(named[3:])
        named[3:] = [f"{more} more"] if more else []
        say(
            f"the record's explanation may be another one than {_named(own)}: {', '.join(named)}; "
            "angle_sigma_deg is wide where they predict something else"
        )
    return write_angles_of(out, log, found.simulation, angle_rad=found.angle_rad, sigma_rad=found.sigma_rad)


def _in_all(models: Sequence[ActuatorModel]) -> list[Effect]:
    """Return the effects that every fit has, and those of the clocks if all models have them."""
    from torsight.actuator.effects import always_fitted

    clocks = (effect for effect in models[0].chosen if effect.is_clock)
    return [*always_fitted(), *(clock for clock in clocks if all(clock in model.chosen for model in models))]


def _acting(model: ActuatorModel, always: Sequence[Effect]) -> dict[str, str]:
    """Return the ids of a model's effects and laws by their law, without the effects that every fit has."""
    own = (effect for effect in model.chosen if effect not in always)
    return {(*effect.laws, effect.id)[0]: effect.id for effect in own} | {form.id: form.id for form in model.laws}


def _named(acting: Mapping[str, str]) -> str:
    return " + ".join(acting.values()) or "the plain model"


def _predict_own(model: Path, record: Path, *, initial: Sequence[str], out: Path) -> Answer:
    """Predict another record with a model of one's own, from initial states 'NAME=VALUE' where they are given."""
    from torsight.discovery.own.answer.saved import read_model
    from torsight.discovery.own.model.quiet import heard

    require_apart([out], [model, record])
    begins = [_named_value(words) for words in initial]
    names = [name for name, _ in begins]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        both = ", ".join(words.strip() for words, name in zip(initial, names, strict=True) if name == twice)
        raise ConfigError(f"'{twice}' is given twice", where="--initial", value=both, do="give it once")
    with heard():
        found = read_model(model, record).predict(record, initial=dict(begins))
    for doubt in found.warnings:
        say(f"note: {doubt}")
    write_table(out, found, clock=next(iter(found)))
    return Answer({"rows": len(next(iter(found.values()))), "columns": list(found)}, files=(out,))


def _named_value(words: str) -> tuple[str, float]:
    """Read 'NAME=VALUE'."""
    name, _, value = words.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise ConfigError("is not NAME=VALUE", where="--initial", value=words, do="write --initial x0=1.5") from None
