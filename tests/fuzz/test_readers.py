"""Whatever stands in a file, a reader ends with a record or with an error that says what and where."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz.readers import READERS, make_neighbours
from torsight.core.errors import TorsightError

TOKENS = [
    *(b"nan", b"inf", b"-1", b"0", b"1e308", b"1e-308", b"9" * 400, b"0x10", b"true", b"null", b"''", b'"', b"[", b"]"),
    *(b"{", b"}", b"=", b",", b";", b"\n", b"\r", b"\0", b"\xff", b"\xef\xbb\xbf", b"#", b"..", b"/dev/null", b"*"),
    *("°".encode(), b"1979-05-27", b"[[", b"]]", b".", b"-", b"e", b"time_s", b"\t", b" "),
]
few = settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("fuzz")
    make_neighbours(made)
    return made


@pytest.fixture
def place(name: str, folder: Path) -> Path:
    """Return a folder for one reader, with the files that its good file names."""
    made = folder / name
    made.mkdir(exist_ok=True)
    make_neighbours(made)
    return made


def meet(read: Callable[[Path], object], path: Path, content: bytes) -> None:
    path.write_bytes(content)
    refused: TorsightError | None = None
    try:
        read(path)
    except TorsightError as error:
        refused = error
    if refused is not None:
        assert len(str(refused).splitlines()) == 1
        assert len(str(refused)) < 2000
        assert refused.exit_code in (2, 3, 4)


@pytest.mark.parametrize("name", READERS)
def test_a_good_file_is_read_or_at_least_named(name: str, place: Path) -> None:
    reader = READERS[name]
    path = place / reader.name
    path.write_bytes(reader.good)
    if name == "provenance":
        with pytest.raises(TorsightError, match=r"film\.avi"):
            reader.read(path)
    else:
        assert reader.read(path) is not None


@pytest.mark.parametrize("name", READERS)
@few
@given(data=st.data())
def test_a_damaged_file_ends_in_a_record_or_an_error(name: str, place: Path, data: st.DataObject) -> None:
    reader = READERS[name]
    content = reader.good
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content)))
        length = data.draw(st.sampled_from([0, 1, 2, 5, 20, 200]))
        put = data.draw(st.one_of(st.sampled_from(TOKENS), st.binary(max_size=4)))
        content = content[:at] + put + content[at + length :]
    meet(reader.read, place / reader.name, content)


@pytest.mark.parametrize("name", ["actuator", "temperature", "merged", "merged parquet", "model"])
@few
@given(content=st.binary(max_size=300))
def test_any_bytes_end_in_an_error(name: str, folder: Path, content: bytes) -> None:
    reader = READERS[name]
    path = folder / f"any {reader.name}"
    path.write_bytes(content)
    with pytest.raises(TorsightError):
        reader.read(path)


numbers = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.integers(-(10**400), 10**400),
    st.booleans(),
    st.text(max_size=5),
    st.lists(st.floats(), max_size=3),
)


@pytest.mark.parametrize("name", ["actuator", "camera", "scene", "board", "tests"])
@few
@given(data=st.data())
def test_any_value_of_a_key_ends_in_a_record_or_an_error(name: str, place: Path, data: st.DataObject) -> None:
    reader = READERS[name]
    lines = reader.good.decode().splitlines()
    index = data.draw(st.sampled_from([i for i, line in enumerate(lines) if "=" in line]))
    lines[index] = f"{lines[index].split('=')[0]} = {_toml(data.draw(numbers))}"
    meet(reader.read, place / reader.name, "\n".join(lines).encode("utf-8", "surrogatepass"))


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, list):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, int) and abs(value) > 10**300:
        return hex(abs(value))  # beyond what Python reads as decimal digits
    return str(value) if isinstance(value, int) else '"' + str(value).replace("\\", "\\\\").replace('"', '\\"') + '"'
