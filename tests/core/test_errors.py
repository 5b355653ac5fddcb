"""Messages say what, where, value, limit and what to do; errors survive a worker process."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from torsight.core.errors import ConfigError, InputError, NoResultError, OutputError, TorsightError
from torsight.core.files.config import get_number, get_text
from torsight.core.files.provenance import file_hash, provenance
from torsight.core.parameter import Estimate, Parameter


def test_the_message_holds_all_parts() -> None:
    error = InputError(
        "is out of range", where="t.csv, row 3", value=300.0, limit="-50 to 200 °C", do="remove the spike"
    )
    assert str(error) == "t.csv, row 3: is out of range; found 300.0; allowed -50 to 200 °C; remove the spike"


@pytest.mark.parametrize(
    ("kind", "code"), [(ConfigError, 2), (InputError, 3), (OutputError, 3), (NoResultError, 4), (TorsightError, 4)]
)
def test_exit_codes_and_pickling(kind: type[TorsightError], code: int) -> None:
    error = kind("what", where="where", value=1, limit="2", do="do")
    again = pickle.loads(pickle.dumps(error))  # noqa: S301 - our own bytes
    assert (type(again), str(again), again.exit_code) == (kind, str(error), code)


@pytest.mark.parametrize("value", [True, "3", float("nan"), [1]])
def test_what_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(ConfigError, match="'fps' is not a number"):
        get_number({"fps": value}, "fps", where="[video]")


def test_choices() -> None:
    with pytest.raises(ConfigError, match="allowed dot, texture"):
        get_text({"kind": "square"}, "kind", where="[markers]", choices=("dot", "texture"))


def test_estimates_without_information_become_null() -> None:
    estimate = Estimate(1.0, float("nan"), (float("-inf"), float("inf")), "s")
    assert estimate.to_json() == {"value": 1.0, "sigma": None, "ci95": [None, None], "unit": "s", "fixed": False}
    assert Parameter("lag_s", 0.0, "s").at(2.0).value == 2.0


def test_provenance_names_inputs_by_hash(tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    folder.mkdir()
    (folder / "b.png").write_bytes(b"b")
    (folder / "a.png").write_bytes(b"a")
    content = provenance(inputs=[folder], configuration={"x": 1}, seed=5, folder=tmp_path / "results")
    assert list(content["inputs"]) == ["../frames/a.png", "../frames/b.png"]
    # SHA-256 of the letter a, from the standard's own test vectors
    assert content["inputs"]["../frames/a.png"].startswith("ca978112ca1bbdcafac231b39a23dc4d")
    with pytest.raises(InputError, match=r"did you mean a\.png"):
        file_hash(folder / "aa.png")
