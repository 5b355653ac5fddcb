"""Check whether another distribution has written into the packages that Torsight installs under common names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Final

from torsight.cli.checkup.finding import Finding
from torsight.core.errors import InputError
from torsight.core.words.wording import listed

OWN: Final = "torsight"
"""Name of this distribution."""
NAMES: Final = ("tracker", "calibration", "sync")
"""Its top-level packages whose names other distributions may use, too."""


def check_install(packages: Mapping[str, Sequence[str]] | None = None) -> list[Finding]:
    """Return findings on other distributions that have a top-level package with a name in :data:`NAMES`.

    Two such distributions in one environment write into one folder: the last one installed overwrites files of the
    other, and removing one deletes files of the other. ``packages`` are the distributions by top-level name; by default
    the installed ones.
    """
    if packages is None:
        from importlib.metadata import packages_distributions

        packages = packages_distributions()
    findings = []
    for name in NAMES:
        others = sorted({one for one in packages.get(name, ()) if one.lower() != OWN})
        if others:
            owner = f"the distribution {listed(others)}"
            text = f"the package '{name}' is also installed by {owner}: files of the two may be mixed."
            advice = (
                "install torsight into an environment of its own, "
                f"or 'pip uninstall {others[0]}' and install torsight again"
            )
            findings.append(Finding("installation", "limits", text, advice))
    return findings


@contextmanager
def own_packages() -> Iterator[None]:
    """Turn a failed import into an error that names the distribution whose package replaces Torsight's, if any.

    Raises InputError for an ``ImportError`` where another distribution has a package of the same name.
    """
    try:
        yield
    except ImportError as error:
        findings = check_install()
        if not findings:
            raise
        found = findings[0]
        raise InputError(found.text.rstrip("."), where=found.about, value=str(error), do=found.do) from error
