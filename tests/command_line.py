"""The command line in this process, for tests."""

from __future__ import annotations

import pytest

from torsight.cli.main import main


def leave(*words: object) -> int:
    """Run a command and return its exit code."""
    with pytest.raises(SystemExit) as end:
        main([str(word) for word in words])
    return int(end.value.code or 0)
