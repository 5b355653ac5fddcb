"""Entry point: the commands, how errors are reported, and the exit codes."""

from __future__ import annotations

import importlib
import itertools
import sys
import traceback
from collections.abc import Callable, Sequence
from functools import cache
from typing import Annotated, Any, Final, cast

import typer

from torsight.cli.ends import Ended, asked_to_end
from torsight.core.errors import ConfigError, InputError, TorsightError, refused_by_system
from torsight.core.lazy import collect_seldom

COMMANDS: Final = (
    "init", "doctor", "demo", "run", "markers", "track", "sync", "fit", "discover", "missing", "simulate",
    "predict", "characterise", "paper", "calibrate", "board", "render", "live", "view", "batch",
)  # fmt: skip
"""Commands in the order of the help; each is the function of its name in ``torsight/cli/<name>.py``."""


_PARSERS: Final = {"calibrate": "TakesRows"}
"""Commands with a parser of their own: the name of its class in the command's module."""


def _version(value: bool) -> None:
    if value:
        from torsight import __version__

        typer.echo(f"torsight {__version__}")
        raise typer.Exit


def _options(
    context: typer.Context,
    *,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and leave.", callback=_version, is_eager=True)
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """From a film of two sticks to a trusted model of the torsion actuator."""
    # The version is shown by its callback; --debug is handled before the parser runs.
    del version, debug
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@cache
def command_line(names: tuple[str, ...] = COMMANDS) -> typer.Typer:
    """Return the command line with some of its commands: importing all takes longer than ``--version`` itself."""
    app = typer.Typer(
        name="torsight",
        help="From a film of two sticks to a trusted model of the torsion actuator.",
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback(invoke_without_command=True)(_options)
    for name in names:
        from torsight.cli.answer import answering

        module = importlib.import_module(f"torsight.cli.{name}")
        parser = getattr(module, _PARSERS[name]) if name in _PARSERS else None
        app.command(name, cls=parser)(answering(getattr(module, name), name=name))
    return app


@cache
def _parser(names: tuple[str, ...]) -> Callable[..., object]:
    """Return the commands in the form their parser needs, made once per process."""
    parser: Any = typer.main.get_command(command_line(names))
    for command in parser.commands.values():
        for item in command.params:
            if item.nargs == -1:
                # typer would name Python's type, list[Path].
                item.display_type = lambda _, item=item: "<path>" if "Path" in item.bare_type() else "<str>"
    return cast("Callable[..., object]", parser)


def _named(words: Sequence[str]) -> tuple[str, ...]:
    """Return the commands needed for these words: the one that is named, none for ``--version``, else all."""
    first = words[0] if words else ""
    return (first,) if first in COMMANDS else () if first == "--version" else COMMANDS


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; leave with the contract's exit code: 0, 2, 3, 4; 128 + its number after a signal."""
    collect_seldom()
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words
    words = [word for word in words if word != "--debug"]
    try:
        with asked_to_end():
            code = _parser(_named(words))(args=words, prog_name="torsight", standalone_mode=False)
    except TorsightError as error:
        _tell(error, debug=debug)
        code = error.exit_code
    except Ended as ended:
        code = 0 if ended.usual else _interrupted(128 + ended.number)
    except KeyboardInterrupt:
        code = _interrupted(130)
    except Exception as error:  # noqa: BLE001 - the last resort: no traceback reaches a user
        code = _other(error, words, debug=debug)
    sys.exit(code if isinstance(code, int) else 0)


def _interrupted(code: int) -> int:
    sys.stderr.write("torsight: interrupted; what was finished is on disk, and --resume of run and track continues\n")
    return code


def _tell(error: Exception, *, debug: bool) -> None:
    if debug:
        traceback.print_exception(error)
    sys.stderr.write(f"torsight: {error}\n")


def _wrong_usage(error: Any, words: Sequence[str]) -> ConfigError:
    """Return the parser's error as one line, with the value that was given to the option, if any."""
    from torsight.core.files.storage import DECIMAL_COMMA

    command = getattr(getattr(error, "ctx", None), "command_path", "torsight")
    missing = hasattr(error, "param_type")
    options = () if missing else getattr(getattr(error, "param", None), "opts", ())
    given = [word.split("=", 1)[1] for word in words if "=" in word and word.split("=", 1)[0] in options]
    given += [after for word, after in itertools.pairwise(words) if word in options]
    value = given[-1] if given else None
    do = f"see '{command} --help'"
    if value is not None and DECIMAL_COMMA.search(value):
        do = f"write a decimal point: {DECIMAL_COMMA.sub('.', value)}"
    return ConfigError(error.format_message().rstrip(".").replace("\n", " "), where=command, value=value, do=do)


def _other(error: Exception, words: Sequence[str], *, debug: bool) -> int:
    """Report wrong usage (exit 2) in the words of typer's parser, anything else as a defect; return the exit code."""
    # The class of typer's usage errors is private and differs between versions; this method identifies them.
    if callable(getattr(error, "format_message", None)):
        _tell(_wrong_usage(error, words), debug=debug)
        return int(getattr(error, "exit_code", 2))
    if isinstance(error, typer.Abort):
        return _interrupted(130)
    if isinstance(error, MemoryError):
        _tell(InputError("needs more memory than there is", value=str(error), do="check the input's size"), debug=debug)
        return 3
    if isinstance(error, OSError) and error.strerror:
        _tell(refused_by_system(error), debug=debug)
        return 3
    if debug:
        traceback.print_exception(error)
    sys.stderr.write(
        f"torsight: internal error, {type(error).__name__}: {error}; please report it with the output of --debug\n"
    )
    return 70  # EX_SOFTWARE of the BSDs' sysexits.h


if __name__ == "__main__":
    main()
