"""Files that are complete or absent: atomic writes, tables, JSON and TOML.

Everything that Torsight writes goes through :func:`atomic_path`: the bytes are written beside the target, flushed to
the disk and renamed, so that a killed run leaves the old file or the new one.
"""

from __future__ import annotations

import contextlib
import difflib
import errno
import json
import math
import os
import re
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TextIO

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import ConfigError, InputError, OutputError, reason_of
from torsight.core.files.config import shown_value
from torsight.core.files.kinds import (
    TABLE_KINDS,
    TOML_KINDS,
    Kind,
    binary_kind,
    kind_of,
    other_kind,
    table_kind,
    toml_kind,
)
from torsight.core.files.paths import missing_file, require_file, unreadable
from torsight.core.units import Flags
from torsight.core.words.wording import meant

if TYPE_CHECKING:
    import pandas as pd

SCHEMA: Final = 1
"""Version of the JSON outputs."""

CSV_SUFFIXES: Final = (".csv", ".txt", ".tsv")
PARQUET_SUFFIXES: Final = (".parquet", ".pq")
DECIMAL_COMMA: Final = re.compile(r"(?<=\d),(?=\d)")
"""A comma between two digits, where a number is meant."""
_PLAIN_CSV: Final = "save it as plain CSV: a header row, commas between columns, '.' as decimal sign, UTF-8"
_WHOLE_PARQUET: Final = "write it again: it may have been cut off, or be another kind of file"


@contextlib.contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yield a temporary path that is renamed to ``path`` when the block ends without an error.

    Raises OutputError when the folder cannot be made or written, or the disk is full; an older ``path`` is then
    unchanged.
    """
    # Hidden, and short enough for the file system together with the suffixes of a temporary name.
    beginning = f".{path.stem[:40]}."
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _sweep(path.parent, beginning, path.suffix)
        handle, name = tempfile.mkstemp(prefix=f"{beginning}{os.getpid()}-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
    except OSError as error:
        raise not_written(path, error) from error
    temporary = Path(name)
    try:
        yield temporary
        # Without this the new name may reach the disk before the content.
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.chmod(0o644)  # a temporary file is its owner's alone
        temporary.replace(path)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) and not isinstance(error, OutputError):
            raise not_written(path, error) from error
        raise


def _sweep(folder: Path, beginning: str, suffix: str) -> None:
    """Remove temporary files of killed processes for the same path."""
    for item in folder.iterdir():
        if item.name.startswith(beginning) and item.suffix == suffix:
            process = item.name[len(beginning) :].partition("-")[0]
            if process.isdigit() and not is_running(int(process)):
                item.unlink(missing_ok=True)


def is_running(process: int) -> bool:
    """Return whether a process with this id runs on this computer; True where that cannot be checked."""
    if os.name != "posix":
        return True  # elsewhere this very question would end the process
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def not_written(path: Path, error: OSError) -> OutputError:
    """Return the error for a path that the system refuses to write."""
    return OutputError(
        f"cannot be written ({reason_of(error)})",
        where=str(path),
        do="choose another folder, or free space and rights there; earlier files are untouched",
    )


def require_writable(path: Path, *, folder: bool) -> None:
    """Refuse a file, or a ``folder`` for files, that cannot be written, before any work; nothing is created.

    Raises OutputError when the system refuses to create a file there, or in the nearest existing folder above.
    """
    try:
        if not folder and path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        above = path.absolute() if folder else path.absolute().parent
        nearest = next(place for place in (above, *above.parents) if _is_there(place))
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise not_written(path, error) from error


def _is_there(path: Path) -> bool:
    """Return whether a path exists, also as a broken link; other errors of the system are raised."""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file atomically."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically, UTF-8."""
    write_bytes(path, text.encode())


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON object with ``"schema"`` in front; numbers that are not finite become null."""
    write_text(path, json_text({"schema": SCHEMA, **content}))


def json_text(content: Mapping[str, Any]) -> str:
    """Return the text of a JSON object: plain types, non-finite numbers as null, a newline at the end."""
    return json.dumps(plain(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def plain(value: Any) -> Any:
    """Return a value in JSON's types: arrays as lists, non-finite numbers as null, paths as text."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object that Torsight wrote.

    Raises InputError when the file is missing, is no JSON object, or has another schema.
    """
    text = read_text(path)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        kind = kind_of(text)
        value = None if kind is None else kind.name
        do = "make the file again" if kind is None else "name the JSON file that torsight wrote"
        raise InputError(f"is not JSON ({error})", where=str(path), value=value, do=do) from error
    if not isinstance(content, dict):
        raise InputError("is not a JSON object", where=str(path), value=type(content).__name__, limit="an object")
    if content.get("schema") != SCHEMA:
        raise InputError(
            "has another schema",
            where=f"{path}, key schema",
            value=shown_value(content, "schema"),
            limit=str(SCHEMA),
            do="make the file again with this version of torsight",
        )
    return content


def read_text(path: Path) -> str:
    """Read a UTF-8 text file (with or without a byte order mark)."""
    content = read_bytes(path)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        kind = binary_kind(content)
        value, do = (None, "save it as UTF-8") if kind is None else (kind.name, kind.source)
        raise InputError("is not UTF-8 text", where=f"{path}, byte {error.start}", value=value, do=do) from error


def read_bytes(path: Path) -> bytes:
    """Read a whole file; a missing, unreadable or special file, or a folder, is refused."""
    require_file(path)
    try:
        return path.read_bytes()
    except OSError as error:
        raise unreadable(path, error) from error


def read_toml(path: Path, *, kind: str = "") -> dict[str, Any]:
    """Read a TOML file of a ``kind`` (a key of :data:`~torsight.core.files.kinds.TOML_KINDS`; empty for any).

    Raises InputError when the file is missing or unreadable; ConfigError when it is not TOML, with line and column in
    the message, or a file of another kind.
    """
    text = read_text(path)
    try:
        content = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number of thousands of digits is a plain ValueError
        other = kind_of(text)
        if other is not None and kind:
            raise other_kind(ConfigError, other, TOML_KINDS[kind], where=path) from error
        at = re.search(r"at line (\d+)", str(error))
        line = text.splitlines()[int(at[1]) - 1].strip() if at else None
        do = "write numbers with a decimal point" if line and DECIMAL_COMMA.search(line) else "mend that line"
        raise ConfigError(f"is not TOML ({error})", where=str(path), value=line, do=do) from error
    found = toml_kind(content)
    if kind and found is not None and not set(TOML_KINDS[kind].signs) & set(content):
        raise other_kind(ConfigError, TOML_KINDS[found], TOML_KINDS[kind], where=path)
    return content


def check_keys(table: Mapping[str, Any], allowed: Sequence[str], *, where: str) -> None:
    """Refuse an unknown key; the message gives the most similar known one."""
    for key in table:
        if key not in allowed:
            raise ConfigError(
                f"unknown key '{key}'", where=where, limit=", ".join(allowed), do=meant(key, allowed) or "remove it"
            )


def is_parquet(path: Path) -> bool:
    """Return whether a table at this path is Parquet (by suffix)."""
    return path.suffix.lower() in PARQUET_SUFFIXES


def write_table(path: Path, columns: Mapping[str, Any], *, clock: str = "time_s") -> None:
    """Write columns of equal length as CSV or, by suffix, as Parquet; another suffix is a ConfigError.

    CSV: header row, ``.`` decimal, ten significant digits, an empty field for NaN; booleans as 0 and 1. The column
    ``clock`` has enough digits to distinguish its rows, whatever the clock's epoch.
    """
    if path.suffix.lower() not in (allowed := (*CSV_SUFFIXES, *PARQUET_SUFFIXES)):
        do = f"choose a name that ends in {allowed[0]}"
        raise ConfigError("has another suffix", where=str(path), value=path.suffix, limit=", ".join(allowed), do=do)
    data = {name: _column(values) for name, values in columns.items()}
    if not is_parquet(path) and _plain_numbers(data):
        with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
            _write_numbers(file, data, clock=clock)
        return
    import pandas as pd

    table = pd.DataFrame(data)
    if clock in table and table[clock].dtype.kind == "f" and not is_parquet(path):
        written = _clock_format(table[clock].to_numpy())
        table[clock] = ["" if time != time else written % time for time in table[clock].tolist()]  # noqa: PLR0124
    with atomic_path(path) as temporary:
        if is_parquet(path):
            table.to_parquet(temporary, index=False)
        else:
            table.to_csv(temporary, index=False, float_format="%.10g", lineterminator="\n")


def _plain_numbers(data: Mapping[str, NDArray[Any]]) -> bool:
    """Return whether columns can be written without pandas, whose import takes as long as tracking a short film."""
    names_are_plain = all(not set(name) & set(',"\r\n') for name in data)
    same = len({array.shape for array in data.values()}) == 1
    return names_are_plain and same and all(array.ndim == 1 and array.dtype.kind in "iuf" for array in data.values())


def _write_numbers(file: TextIO, data: Mapping[str, NDArray[Any]], *, clock: str) -> None:
    """Write numeric columns as CSV, in blocks of rows: lists are faster than single numbers, and memory stays small.

    Eight columns of 120,000 rows take a quarter of a second with 64 rows as with 65,536, which need 40 MB more.
    """
    file.write(",".join(data) + "\n")
    formats = {name: "%.10g" if array.dtype.kind == "f" else "%d" for name, array in data.items()}
    if formats.get(clock) == "%.10g":
        formats[clock] = _clock_format(data[clock])
    row, block = ",".join(formats.values()) + "\n", 4096
    for first in range(0, len(next(iter(data.values()))), block):
        rows = zip(*(array[first : first + block].tolist() for array in data.values()), strict=True)
        file.write("".join([row % values for values in rows]).replace("nan", ""))


def _clock_format(time: NDArray[Any]) -> str:
    """Return the format of times (n,): ten significant digits, or more where these round the shortest step.

    A step of 0.5 s of a clock that counts from 1970 begins at the eleventh digit. Three digits of the shortest step are
    written, so that a rate over this step is right to a thousandth. Where this needs more digits than every float has,
    the format is the shortest text that is read as the same float.
    """
    step = np.abs(np.diff(time))
    step = step[step > 0.0]
    largest = np.max(np.abs(time[np.isfinite(time)]), initial=0.0)
    if len(step) == 0 or not np.isfinite(step).any():
        return "%.10g"
    digits = math.floor(math.log10(largest)) - math.floor(math.log10(step.min())) + 3
    return f"%.{max(digits, 10)}g" if digits <= sys.float_info.dig else "%r"


def _column(values: Any) -> NDArray[Any]:
    array = np.asarray(values)
    return array.astype(np.int8) if array.dtype == np.bool_ else array


def read_table(path: Path, *, required: Sequence[str] = ()) -> pd.DataFrame:
    """Read a CSV or Parquet table (by suffix) that Torsight or another lab's script wrote.

    The required columns must exist and hold numbers; they are returned as float64, with NaN for an empty field. The
    message of a refusal gives row and column.
    """
    import pandas as pd

    if not path.exists():
        raise missing_file(path)
    wanted = next((one for one in TABLE_KINDS.values() if one.signs == tuple(required)), None)
    require_table(path, wanted)
    try:
        table = pd.read_parquet(path) if is_parquet(path) else _read_csv(path)
    except pd.errors.EmptyDataError as error:
        raise empty_table(path) from error
    except PermissionError as error:
        raise unreadable(path, error) from error
    except _damages_of(path) as error:
        first_line = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        # A film may be larger than the memory: one buffer of it is enough.
        with path.open("rb") as file:
            kind = binary_kind(file.peek())
        value, do = (None, _PLAIN_CSV) if kind is None else (kind.name, kind.source)
        if is_parquet(path):
            do = _WHOLE_PARQUET
        raise InputError(f"is not a readable table ({first_line})", where=str(path), value=value, do=do) from error
    table.columns = [str(name).strip() for name in table.columns]
    for name in required:
        if name not in table.columns:
            other = table_kind(table.columns, wanted)
            if wanted is not None and other is not None:
                raise other_kind(InputError, other, wanted, where=path)
            # Do not suggest renaming a column that is itself required.
            near = difflib.get_close_matches(name, [one for one in table.columns if one not in required], n=1)
            raise InputError(
                f"has no column '{name}'",
                where=str(path),
                value=", ".join(table.columns[:12]),
                do=f"rename '{near[0]}'" if near else "add the column" if wanted is None else wanted.source,
            )
        table[name] = number_column(table, name, where=str(path))
    if len(table) == 0:
        raise table_without_rows(path)
    return table


def require_table(path: Path, wanted: Kind | None) -> None:
    """Refuse a folder, a pipe or a TOML file in place of a table of the kind ``wanted``."""
    require_file(path)
    other = None
    if path.suffix.lower() == ".toml":
        with contextlib.suppress(OSError, ValueError):
            other = kind_of(path.read_text(encoding="utf-8-sig"))
    if other is not None and other not in TABLE_KINDS.values():
        raise InputError(f"is {other.name}", where=str(path), limit="a table" if wanted is None else wanted.name)


def empty_table(path: Path) -> InputError:
    """Return the error for an empty table file."""
    return InputError("is empty", where=str(path), do="record it again, with a header row")


def table_without_rows(path: Path) -> InputError:
    """Return the error for a table with a header but no rows."""
    return InputError("has a header but no rows", where=str(path), do="record it again")


def _damages_of(path: Path) -> tuple[type[Exception], ...]:
    """Return the exceptions that a damaged table of this kind raises (the parser's own are ValueErrors)."""
    usual = (OSError, ValueError, OverflowError)
    if not is_parquet(path):
        return usual
    import pyarrow as pa

    return (*usual, pa.ArrowException, KeyError, TypeError, AttributeError, NotImplementedError)


def _read_csv(path: Path) -> pd.DataFrame:
    """Return a text table; where semicolons or tabs separate the columns, numbers may have a decimal comma."""
    import pandas as pd

    with path.open(encoding="utf-8-sig") as file:
        first = file.readline()
    mark = next((one for one in ";\t" if one in first and "," not in first), ",")
    points = "." if mark == "," else ".,"
    read = [pd.read_csv(path, sep=mark, decimal=point, encoding="utf-8-sig") for point in points]
    table = max(read, key=lambda one: one.select_dtypes("number").shape[1])
    # pandas reads equal names as "name" and "name.1". Restore the names, so that a required column that is there twice
    # is refused.
    header = pd.read_csv(path, sep=mark, encoding="utf-8-sig", header=None, nrows=1, dtype=str).iloc[0]
    if len(header) == len(table.columns) and header.notna().all():
        table.columns = pd.Index(header)
    return table


def first_row(
    wrong: Flags, *, where: str | Path, column: str, lines: Sequence[int] | None = None
) -> list[tuple[int, str]]:
    """Return the first row that is ``wrong`` (n,), with its file, line and column for messages; [] if none is.

    ``lines`` are the rows' lines in the file; without them row 0 is on line 2.
    """
    rows = np.flatnonzero(wrong)[:1].tolist()
    return [(row, f"{where}, row {row + 2 if lines is None else lines[row]}, column {column}") for row in rows]


def number_column(
    table: pd.DataFrame, name: str, *, where: str, called: str = "", lines: Sequence[int] | None = None
) -> pd.Series[float]:
    """Return a column of a table as float64, an empty field as NaN; ``lines`` as in :func:`first_row`.

    ``called`` is the file's own name of the column, for messages.
    """
    import pandas as pd

    if list(table.columns).count(name) > 1:
        raise InputError("has this column twice", where=f"{where}, column {name}", do="remove one of the two")
    numbers = pd.to_numeric(table[name], errors="coerce").astype(np.float64)
    wrong = (numbers.isna() & table[name].notna()).to_numpy()
    for row, place in first_row(wrong, where=where, column=called or name, lines=lines):
        raise InputError(
            "is not a number",
            where=place,
            value=repr(table[name].iloc[row]),
            limit="a number or an empty field",
            do="mend that row",
        )
    return numbers
