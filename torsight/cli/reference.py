"""The command reference, written from the commands themselves when the pages are built."""

from __future__ import annotations

from typing import Any

from torsight.cli.main import app

_HEAD = """# Commands

Written from the commands themselves by `make docs`; `torsight COMMAND --help` says the same. Everything for people
goes to standard error; with `--json` standard output holds one object, see [](scripts.md). Exit codes: 0 done, 2 wrong
usage or configuration, 3 an input that cannot be used, 4 no result could be had; 130 after Ctrl-C.
`--debug`, before or after the command, shows the traceback of an error.
"""


def command_reference() -> str:
    """Return the reference of all commands as Markdown, in the order of the help."""
    import typer

    group: Any = typer.main.get_command(app)
    return "\n".join([_HEAD, *(_section(name, command) for name, command in group.commands.items())])


def _section(name: str, command: Any) -> str:
    text, _, example = (command.help or "").partition("Example: ")
    arguments = [item for item in command.params if item.param_type_name == "argument"]
    options = [item for item in command.params if item.param_type_name == "option"]
    lines = [f"## torsight {name}", "", text.strip(), "", "```console", f"$ {example.strip()}", "```", ""]
    rows = [(_argument(item), item.help or "") for item in arguments]
    rows += [(_option(item), _option_help(item)) for item in options if item.name != "help"]
    lines += ["| | |", "| --- | --- |"]
    lines += [f"| `{left}` | {' '.join(right.split())} |" for left, right in rows]
    return "\n".join([*lines, ""])


def _argument(item: Any) -> str:
    name = (item.metavar or str(item.name).upper()).strip("[]{}").replace("|", "\\|")
    return name if item.required else f"[{name}]"


def _option(item: Any) -> str:
    flags = " / ".join(flag for flag in [*item.opts, *item.secondary_opts] if flag.startswith("--"))
    if item.is_flag:
        return flags
    return f"{flags} {item.metavar or str(item.name).upper()}"


def _option_help(item: Any) -> str:
    words = item.help or ""
    if item.required:
        return f"{words} Required."
    plain = isinstance(item.default, (int, float, str)) and not isinstance(item.default, bool)
    return f"{words} Default {item.default}." if plain else words
