"""A model file: ``model.py`` with ``predict``, ``parameters``, ``output`` and what else ``model_problem`` takes.

Or with ``problem(records)``, which returns the problem itself.
"""

from __future__ import annotations

import ast
import contextlib
import difflib
import importlib.machinery
import importlib.util
import sys
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, Final

from torsight.core.errors import InputError
from torsight.core.parameter import Parameter
from torsight.discovery.interface import Candidate
from torsight.discovery.own.model.declare import candidates_of, parameters_of
from torsight.discovery.own.model.evaluate import CompiledPredict, Predict
from torsight.discovery.own.model.layout import Reading
from torsight.discovery.own.model.problem import ModelProblem, model_problem
from torsight.discovery.own.model.quiet import heard
from torsight.discovery.own.own_records import Record
from torsight.discovery.own.syntax import parsed

NEEDED: Final = ("predict", "parameters", "output")
"""Names that a model file without ``problem`` defines."""
READING: Final = tuple(one.name for one in fields(Reading))
OPTIONS: Final = ("candidates", "laws", "initial", "drivers", *READING)
"""Names that a model file may define beside them: arguments of ``model_problem`` and ``Reading``, and laws apart from
the candidates."""


@dataclass(frozen=True, slots=True)
class Declared:
    """The declarations of a model file that a prediction needs: the function, and the values it is called with."""

    predict: Predict
    parameters: tuple[Parameter, ...]
    candidates: tuple[Candidate, ...]
    outputs: tuple[str, ...]
    time: str | None

    @property
    def every_parameter(self) -> list[Parameter]:
        """The model's own parameters, and those of its candidates."""
        return [*self.parameters, *(p for one in self.candidates for p in one.parameters)]


def declared_in(problem: ModelProblem) -> Declared:
    """Return the declarations of a problem, with the function as its author wrote it."""
    predict = problem.model.predict
    plain = predict.plain if isinstance(predict, CompiledPredict) else predict
    return Declared(plain, problem.declared, problem.candidates, problem.model.outputs, problem.time_name)


def load_model_file(path: Path) -> ModuleType:
    """Run a model file.

    Raises InputError when the file is missing, or fails: with the line that failed; the file's own traceback is a note
    of the error.
    """
    parsed(path)
    name = f"torsight_model_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path, loader=_AsItStands(name, str(path)))
    assert spec is not None and spec.loader is not None  # noqa: S101, PT018 - for the type checker: a loader is given
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    with _beside(path.parent):
        try:
            with heard():
                spec.loader.exec_module(module)
        except (Exception, SystemExit) as error:
            raise _failed(path, error) from error
    import cloudpickle

    # Processes cannot import it by its name.
    cloudpickle.register_pickle_by_value(module)
    return module


class _AsItStands(importlib.machinery.SourceFileLoader):
    """Loads the source: cached bytecode may belong to an earlier version of the same second and the same length."""

    def get_code(self, fullname: str) -> CodeType | None:  # noqa: ARG002 - importlib asks by name
        """Return the file's code, compiled anew."""
        return self.source_to_code(self.get_data(self.path), self.path)


@contextlib.contextmanager
def _beside(folder: Path) -> Iterator[None]:
    """Let a model file import modules in its own folder."""
    own = str(folder.resolve())
    sys.path.insert(0, own)
    try:
        yield
    finally:
        sys.path.remove(own)


def _failed(path: Path, error: BaseException) -> InputError:
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path.resolve()]
    frames = frames or [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    line = frames[-1].lineno if frames else None
    # An InputError says what failed; of other errors the type is named, too.
    what = str(error) if isinstance(error, InputError) else f"cannot be imported: {type(error).__name__}: {error}"
    where = str(path) if line is None else f"{path}, line {line}"
    failed = InputError(what, where=where, do="correct the file; --debug shows its own traceback")
    own = "".join(traceback.format_list(frames) + traceback.format_exception_only(error))
    failed.add_note(f"The model file's own traceback:\n{own}")
    return failed


def problem_of(path: Path, records: Sequence[Record | Path | str]) -> ModelProblem:
    """Return the problem that a model file defines for records."""
    module = load_model_file(path)
    made: Any
    if hasattr(module, "problem"):
        with heard():
            try:
                made = module.problem(list(records))
            except InputError:
                raise
            except (Exception, SystemExit) as error:
                raise _failed(path, error) from error
        if not isinstance(made, ModelProblem):
            do = "return model_problem(…) from it"
            raise InputError("gives no problem", where=f"{path}, problem(records)", value=type(made).__name__, do=do)
        return made
    _require(module, path)
    _require_spelling(module, path)
    try:
        options = _options(module)
        reading = Reading(**{name: options.pop(name) for name in READING if name in options})
        return model_problem(
            module.predict, list(records), module.parameters, output=module.output, reading=reading, **options
        )
    except InputError as error:
        error.where = f"{path}: {error.where}" if error.where else str(path)
        raise


def declared_of(path: Path, record: Path) -> Declared:
    """Return the declarations of a model file, for a record that need not hold the outputs.

    A file with ``problem(records)`` is asked for the problem of that record, which then has to hold the outputs.
    """
    module = load_model_file(path)
    if hasattr(module, "problem"):
        return declared_in(problem_of(path, [record]))
    _require(module, path)
    output, options = module.output, _options(module)
    return Declared(
        module.predict,
        parameters_of(module.parameters),
        tuple(one for one in options["candidates"] if isinstance(one, Candidate)),
        (output,) if isinstance(output, str) else tuple(output),
        options.get("time"),
    )


def _options(module: ModuleType) -> dict[str, Any]:
    """Return the options that a model file names, its laws among the candidates."""
    # A model file with 'import time' does not thereby name its column of the time.
    named = {name: value for name in OPTIONS if not isinstance(value := vars(module).get(name), ModuleType)}
    found = {name: value for name, value in named.items() if value is not None}
    may_lack = ((name, found.pop(name, ())) for name in ("candidates", "laws"))
    found["candidates"] = tuple(one for name, some in may_lack for one in candidates_of(some, name))
    return found


def _require_spelling(module: ModuleType, path: Path) -> None:
    """Refuse a variable that the file does not use and whose name is close to a setting's: it would have no effect."""
    names = [node for node in ast.walk(parsed(path)) if isinstance(node, ast.Name)]
    read = {node.id for node in names if not isinstance(node.ctx, ast.Store)}
    for node in names:
        idle = node.id in vars(module) and node.id not in read and node.id not in (*NEEDED, *OPTIONS)
        near = difflib.get_close_matches(node.id, OPTIONS, n=1) if idle else []
        if near:
            raise InputError(
                f"'{node.id}' is no setting, and nothing reads it",
                where=f"{path}, line {node.lineno}",
                limit=", ".join(OPTIONS),
                do=f"did you mean '{near[0]}'? Otherwise give it another name",
            )


def _require(module: ModuleType, path: Path) -> None:
    missing = [name for name in NEEDED if not hasattr(module, name)]
    if missing:
        limit = f"{', '.join(NEEDED)}, and if wanted {', '.join(OPTIONS)}; or problem(records)"
        raise InputError(f"does not define {', '.join(missing)}", where=str(path), limit=limit)
