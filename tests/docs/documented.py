"""Which commands the pages hold, in the order in which they stand there."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
WRITTEN = ("commands.md", "effects_library.md")
"""Pages that are written from the code when the site is built."""
PAGES = sorted(path for path in [*DOCS.glob("*.md"), ROOT / "README.md"] if path.name not in WRITTEN)
PROGRAMS = ("torsight", "python", "make", ".")
"""With what a command of the pages begins."""

_CONSOLE = re.compile(r"```console\n(?P<lines>.*?)```", flags=re.DOTALL)
_INLINE = re.compile(rf"(?<!`)`(?P<words>(?:{'|'.join(PROGRAMS[:3])}) [^`]+)`")


def command_reference() -> str:
    """Return the page of all commands."""
    return str(runpy.run_path(str(DOCS / "conf.py"))["command_reference"]())


def commands(text: str) -> list[str]:
    """Return every command of a page: the lines of its console blocks, and those that stand whole in its sentences."""
    found: list[str] = []
    for piece in re.finditer(f"{_CONSOLE.pattern}|{_INLINE.pattern}", text, flags=re.DOTALL):
        if piece["lines"] is not None:
            found += [line[2:].partition("#")[0].strip() for line in piece["lines"].splitlines() if line[:2] == "$ "]
        elif _is_whole(piece["words"]):
            found.append(" ".join(piece["words"].split()))
    return found


def named(text: str) -> list[str]:
    """Return the commands that a page only names in its sentences, as ``torsight sync``."""
    found = [" ".join(piece["words"].split()) for piece in _INLINE.finditer(text)]
    return [
        words for words in found if words.startswith("torsight") and not _is_whole(words) and "COMMAND" not in words
    ]


def _is_whole(words: str) -> bool:
    """Return whether a command can be given as it stands, with every argument."""
    _, *arguments = words.split()
    return len(arguments) > 1 and "…" not in words and not any(word.isupper() for word in arguments)


def documented_names(file: str) -> list[str]:
    """Return the columns or keys that the page on running lists for a file."""
    text = (DOCS / "running.md").read_text(encoding="utf-8")
    table = re.split(r"\n\n(?!\|)", text.partition(f"\n`{file}`")[2].partition("| --- | --- |")[2])[0]
    first = "".join(row.split("|")[1] for row in table.splitlines() if row.startswith("|"))
    return re.findall(r"`(\w+)`", first)
