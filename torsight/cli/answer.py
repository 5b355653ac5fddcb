"""Common wrapper of all commands: it checks that outputs can be written before any work, and adds ``--json``.

A command returns an :class:`Answer`; :func:`answering` adds the option ``--json``. With this option standard output
holds one JSON object and nothing else, whether the command succeeds or fails; text for people goes to standard error.
"""

from __future__ import annotations

import functools
import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final

from typer import Option

from torsight.cli.checkup.install import own_packages
from torsight.core.errors import ConfigError, TorsightError
from torsight.core.files.storage import PARQUET_SUFFIXES, SCHEMA, json_text, require_writable

_WRITTEN: Final = ("out", "table", "export_effect", "preview", "pictures")
"""Parameters of commands that name an output."""
_ALSO: Final = {".csv": PARQUET_SUFFIXES, ".svg": (".pdf", ".png")}
"""Suffixes of outputs that an option takes beside the one in its metavar."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A command's answer to a script: its result (the content of its JSON file, if any), and the files written.

    ``exit_code`` is 0, or another exit code of the contract where the command fails but still has an answer.
    """

    result: Mapping[str, Any]
    files: Sequence[Path] = field(default=())
    exit_code: int = 0


def answering(command: Callable[..., Answer | None], *, name: str) -> Callable[..., int]:
    """Return the command, with the option ``--json`` where it returns an :class:`Answer`.

    The command ends before its work, which may take minutes, where its outputs cannot be written.
    """
    signature = inspect.signature(command, eval_str=True)
    for parameter in signature.parameters.values():
        for given in getattr(parameter.annotation, "__metadata__", ()):
            # Its reader refuses an unreadable input, as it does any other that cannot be used (exit code 3).
            given.readable = False
    run = _writable_first(own_packages()(command), signature)

    @functools.wraps(command)
    def answered(*arguments: Any, as_json: bool = False, **options: Any) -> int:
        try:
            answer = run(*arguments, **options)
        except TorsightError as error:
            if as_json:
                _put(name, exit_code=error.exit_code, error=_error_content(error))
            raise
        if answer is None:
            return 0
        if as_json:
            files = {path.name: str(path) for path in answer.files}
            _put(name, exit_code=answer.exit_code, files=files, result=answer.result)
        return answer.exit_code

    if signature.return_annotation is not Answer:
        return answered
    option = inspect.Parameter(
        "as_json",
        inspect.Parameter.KEYWORD_ONLY,
        default=False,
        annotation=Annotated[bool, Option("--json", help="Answer with one JSON object on standard output.")],
    )
    parameters = [*signature.parameters.values(), option]
    answered.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    answered.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return answered


def _writable_first(
    command: Callable[..., Answer | None], signature: inspect.Signature
) -> Callable[..., Answer | None]:
    """Return the command preceded by a check that its outputs can be written: files where the metavar has a suffix.

    A file's suffix decides its format: another one than the option takes is refused.
    """
    suffixes = {
        name: Path(parameter.annotation.__metadata__[0].metavar or "").suffix.lower()
        for name, parameter in signature.parameters.items()
        if name in _WRITTEN
    }

    def checked(*arguments: Any, **options: Any) -> Answer | None:
        given = signature.bind(*arguments, **options).arguments
        for name, suffix in suffixes.items():
            path, taken = given.get(name), (suffix, *_ALSO.get(suffix, ()))
            if path is None:
                continue
            require_writable(path, folder=not suffix)
            if suffix and path.suffix.lower() not in taken:
                option, do = f"--{name.replace('_', '-')}", f"choose a name that ends in {suffix}"
                raise ConfigError("has another suffix", where=option, value=str(path), limit=", ".join(taken), do=do)
        return command(*arguments, **options)

    return checked


def _put(name: str, *, exit_code: int, **content: Any) -> None:
    sys.stdout.write(json_text({"schema": SCHEMA, "command": f"torsight {name}", "exit_code": exit_code, **content}))
    sys.stdout.flush()


def _error_content(error: TorsightError) -> dict[str, Any]:
    value = None if error.value is None else str(error.value)
    parts = {"what": error.what, "where": error.where, "value": value, "limit": error.limit, "do": error.do}
    return {"message": str(error), **parts}
