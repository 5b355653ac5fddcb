"""A measured law written as an effect of the library: one Python file for the effects' folder."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from torsight.actuator.effects import load_effects
from torsight.actuator.fitted import FittedModel
from torsight.actuator.laws import FAMILIES
from torsight.core.errors import ConfigError, NoResultError
from torsight.core.files.storage import write_text
from torsight.core.law import LawForm
from torsight.core.units import Floats
from torsight.core.words.wording import capital
from torsight.discovery.measured_law import MeasuredLaw

_ID: Final = re.compile(r"[a-z][a-z0-9_]*")
_WORDS: Final = (
    "x {driver}, g_0 the measured law ({unit}), a curve through its nodes and held beyond them, s its share: 1 as "
    "measured, 0 without it. {sentence}. Predicted residual: what the record showed from which it was measured. "
    "Source: a record of this rig, by torsight discover."
)
_TEMPLATE: Final = '''r"""{heading}, as it was measured.

.. math:: g(x) = s \\, g_0(x)

{words}
"""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.actuator.laws import FAMILIES, between_nodes

NODES: Final = (
{nodes}
)
"""Values of the driver."""
LAW: Final = (
{values}
)
"""The law there."""


def apply(ports: Ports, values: Values) -> Ports:
    """Let the law act at its port."""
    curve = between_nodes("{law}", np.array(NODES), values["{name}_share"] * np.array(LAW))
    return FAMILIES["{law}"].apply(ports, lambda driver: np.interp(driver, *curve))


EFFECT = Effect(
    id="{name}",
    family="measured",
    acts_on="{stage}",
    title="{title}",
    parameters=(
        Parameter(
            name="{name}_share",
            value=1.0,
            unit="",
            lower=0.0,
            upper=5.0,
            null=0.0,
            symbol="s",
            title="share of the measured law",
        ),
    ),
    apply=apply,
    laws=("{law}",),
)
'''


def export_effect(path: Path, model: FittedModel, laws: tuple[MeasuredLaw, ...]) -> None:
    """Write the strongest of the measured laws, the first, as an effect; the file's name, ``<id>.py``, is its id.

    Raises ConfigError when the file's name is not a valid id, or is the id of an effect of the library; NoResultError
    when no law was measured.
    """
    name = path.stem
    if path.suffix != ".py" or not _ID.fullmatch(name) or name in load_effects():
        limit = "a new id in small letters, digits and _, with .py"
        do = "name it by what it is, for example lead_wires.py"
        raise ConfigError("is no name for a new effect", where="--export-effect", value=str(path), limit=limit, do=do)
    if not model.model.laws:
        do = "read the verdict in the report"
        raise NoResultError("no law was measured, so there is none to write", where="--export-effect", do=do)
    form = next(form for form in model.model.laws if form.id == laws[0].id)
    write_text(path, effect_source(name, form, model.values, sentence=laws[0].sentence))


def effect_source(name: str, form: LawForm, values: Mapping[str, float], *, sentence: str) -> str:
    """Return the source code of an effect that is a law with the given parameters."""
    family = FAMILIES[form.id]
    law = form.values(values)
    words = _WORDS.format(
        driver=family.over or family.driver, unit=family.unit or "a share", sentence=capital(sentence)
    )
    return _TEMPLATE.format(
        name=name,
        law=form.id,
        title=family.title,
        heading=capital(family.title),
        stage=family.stage,
        words=textwrap.fill(words, 120),
        nodes=_rows(form.nodes),
        values=_rows(law),
    )


def _rows(numbers: Floats) -> str:
    """Return numbers with six digits each, six to a line."""
    words = [f"{value:.6g}" for value in numbers.tolist()]
    lines = (", ".join(words[i : i + 6]) for i in range(0, len(words), 6))
    return "\n".join(f"    {line}," for line in lines)
