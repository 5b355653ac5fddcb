"""Sphinx: the pages from this folder; commands, effects and the Python reference are generated from the code.

Formulas are MathML; the notebooks run while the pages are built.

Nothing is downloaded while the pages are built or read.
"""

from __future__ import annotations

import inspect
from html import escape
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
from docutils.utils.math import MathError, latex2mathml

from torsight import __version__
from torsight.actuator.effects import Effect, load_effects
from torsight.cli.main import command_line
from torsight.core.lazy import collect_seldom

collect_seldom()

HERE = Path(__file__).parent

project = "Torsight"
author = "The Torsight developers"
copyright = "the Torsight developers"  # noqa: A001 - the name that Sphinx asks for
release = version = __version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 240
nb_merge_streams = True
exclude_patterns = ["_build"]
autodoc_typehints = "none"  # the docstrings say shapes and units
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
suppress_warnings = ["ref.python"]  # attributes of one name in several classes
html_theme = "furo"
html_title = "Torsight"
html_copy_source = False
html_show_sphinx = False
pygments_style = "default"
html_math_renderer = "mathml"


def library() -> str:
    """Return the page of all effects: their docstrings and parameters."""
    pages = [_effect(name, effect) for name, effect in load_effects().items()]
    return "\n".join(
        ["# The library of effects", "", "Generated from `torsight/actuator/effects/` by `make docs`.", "", *pages]
    )


PACKAGES = (
    *("tracker", "calibration", "sync", "torsight.core", "torsight.actuator", "torsight.discovery"),
    *("torsight.synthetic", "torsight.report", "torsight.viewer"),
)
"""Packages whose public names are the reference for Python."""
_CONSTANTS = ("DEG", "GPA", "MM", "MNM", "MPA", "MARKERS", "Progress")
"""Public names that are neither classes nor functions: their modules describe them."""


def reference(package: str) -> str:
    """Return the page of a package: its docstring, and that of every public class and function."""
    module = import_module(package)
    names = getattr(module, "__all__", None) or [name for name in dir(module) if not name.startswith("_")]
    known = [(name, getattr(module, name)) for name in names if name not in _CONSTANTS]
    shown = sorted(known, key=lambda item: (inspect.isfunction(item[1]), item[0].lower()))
    lines = [f"# {package}", "", "```{eval-rst}", f".. py:module:: {package}", ""]
    lines += [inspect.cleandoc(module.__doc__ or ""), ""]
    for name, value in shown:
        kind = "autofunction" if inspect.isfunction(inspect.unwrap(value)) else "autoclass"
        lines += [f".. {kind}:: {package}.{name}", *(["   :members:", ""] if kind == "autoclass" else [""])]
    return "\n".join([*lines, "```", ""])


def _effect(name: str, effect: Effect) -> str:
    text = inspect.cleandoc(import_module(f"torsight.actuator.effects.{name}").__doc__ or "")
    laws = " or ".join(f"`{law}`" for law in effect.laws)
    form = f"; a usual form of {laws}" if laws else ""
    lines = [f"## {name}", "", f"*{effect.title}*; acts on {effect.acts_on}, family {effect.family}{form}.", ""]
    lines += ["```{eval-rst}", text, "```", "", "| parameter | unit | start | bounds | vanishes at | prior |"]
    lines.append("| --- | --- | --- | --- | --- | --- |")
    for one in effect.parameters:
        null = "–" if one.null is None else f"{one.null:g}"
        sigma = "–" if one.sigma is None else f"± {one.sigma:g}"
        bounds = f"{one.lower:g} to {one.upper:g}"
        lines.append(f"| `{one.name}` | {one.unit or '–'} | {one.value:g} | {bounds} | {null} | {sigma} |")
    return "\n".join([*lines, ""])


_HEAD = """# Commands

Generated from the commands by `make docs`; `torsight COMMAND --help` prints the same. Text for people goes to standard
error; with `--json` standard output holds one JSON object ([](scripts.md)). Exit codes: 0 done, 2 wrong usage or
configuration, 3 an input that cannot be used, 4 no result is possible; 130 after Ctrl-C.
`--debug`, before or after the command, shows the traceback of an error.
"""


def command_reference() -> str:
    """Return the reference of all commands as Markdown, in the order of the help."""
    group: Any = typer.main.get_command(command_line())
    return "\n".join([_HEAD, *(_section(name, command) for name, command in group.commands.items())])


def _section(name: str, command: Any) -> str:
    text, *examples = (command.help or "").split("Example: ")
    arguments = [item for item in command.params if item.param_type_name == "argument"]
    options = [item for item in command.params if item.param_type_name == "option"]
    shown = [f"$ {' '.join(example.split())}" for example in examples]
    lines = [f"## torsight {name}", "", *_paragraphs(text), "```console", *shown, "```", ""]
    rows = [(_argument(item), item.help or "") for item in arguments]
    rows += [(_option(item), _option_help(item)) for item in options if item.name != "help"]
    lines += ["| | |", "| --- | --- |"]
    lines += [f"| `{left}` | {' '.join(right.split())} |" for left, right in rows]
    return "\n".join([*lines, ""])


def _paragraphs(text: str) -> list[str]:
    """Return the paragraphs of a help text; a paragraph that keeps its lines becomes a block of Python."""
    parts = text.strip().split("\n\n")
    return [f"```python\n{part[1:].strip()}\n```\n" if part.startswith("\b") else f"{part}\n" for part in parts]


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


_PLAIN = str.maketrans(
    {"−": "-", "·": r"\cdot ", "≤": r"\le ", "≥": r"\ge ", "…": r"\ldots ", "→": r"\to ", "²": "^2", "³": "^3"}
)


def _math(node: Any, *, block: bool) -> str:
    """Return a formula as MathML; a formula that the converter does not know is shown as its source."""
    try:
        return str(latex2mathml.tex2mathml(node.astext().translate(_PLAIN), as_block=block))
    except MathError:
        return f"<code>{escape(node.astext())}</code>"


def _inline(writer: Any, node: Any) -> None:
    writer.body.append(_math(node, block=False))
    raise _skip()


def _display(writer: Any, node: Any) -> None:
    writer.body.append(f'<div class="math">{_math(node, block=True)}</div>')
    raise _skip()


def _skip() -> Exception:
    from docutils.nodes import SkipNode

    return SkipNode()


def _write_pages(_app: Any, _config: Any) -> None:
    """Write the pages that are generated from the code; unchanged files are kept, so that they are not built again."""
    pages = {"effects_library.md": library(), "commands.md": command_reference()}
    pages |= {f"reference/{package}.md": reference(package) for package in PACKAGES}
    (HERE / "reference").mkdir(exist_ok=True)
    for name, text in pages.items():
        target = HERE / name
        if not target.exists() or target.read_text(encoding="utf-8") != text:
            target.write_text(text, encoding="utf-8")


def setup(app: Any) -> None:
    """Connect the generated pages and the formulas to Sphinx."""
    app.connect("config-inited", _write_pages)
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
