"""Fixtures that all tests share."""

from __future__ import annotations

import os
import re
import shutil
import signal
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from xdist.scheduler.loadscope import LoadScopeScheduling

from torsight.core.lazy import collect_seldom
from torsight.core.parallel.threads import VARIABLES

# Before anything loads numpy: threads of linear algebra that wait for each other beside other workers take the engine's
# tests five times as long, and every stage of the product computes with one.
os.environ.update(dict.fromkeys(VARIABLES, "1"))
# Nor huge pages for arrays of 4 MB and more: a virtual machine's host takes 10 ms to provide one of 2 MB, and of arrays
# that are hardly filled it has to provide them all: the tests of tracking took a sixteenth longer.
os.environ["NUMPY_MADVISE_HUGEPAGE"] = "0"

collect_seldom()

# No test depends on how fast a machine is.
settings.register_profile("torsight", deadline=None)
settings.load_profile("torsight")

# Tests end processes as a terminal does. Where a shell has started this one with those signals ignored (in the
# background, under nohup), all that it starts would ignore them as well.
for name in ("SIGINT", "SIGHUP"):
    number = getattr(signal, name, None)
    if number is not None and signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.default_int_handler if name == "SIGINT" else signal.SIG_DFL)

HERE = Path(__file__).parent
ROOT = HERE.parent


class ByMade(LoadScopeScheduling):
    """Give out single tests one by one; those that share what is made once go to one worker together.

    The largest groups come first and single tests last, so that no worker waits for long.
    """

    def _split_scope(self, nodeid: str) -> str:
        return sharing(nodeid.partition("::")[0]) or nodeid


@cache
def sharing(path: str) -> str:
    """Return the folder or file of tests that shares what is made once; empty where nothing is shared.

    A folder shares the fixtures of a session in its ``conftest.py``; a file shares the fixtures of a module, there or
    beside it, and what its own functions keep.
    """
    file = ROOT / path
    for folder in file.relative_to(HERE).parents[-2::-1]:
        if re.search('scope="session"', conftest(HERE / folder)):
            return str(folder)
    kept = re.search(
        r'scope="\w+"|^@(functools\.)?(lru_)?cache\b', file.read_text(encoding="utf-8"), flags=re.MULTILINE
    )
    return path if kept or 'scope="module"' in conftest(file.parent) else ""


def conftest(folder: Path) -> str:
    """Return the text of a folder's ``conftest.py``; empty where there is none."""
    path = folder / "conftest.py"
    return path.read_text(encoding="utf-8") if path.exists() else ""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByMade:
    """Choose how tests are given to workers."""
    return ByMade(config, log)


@pytest.fixture(scope="session", autouse=True)
def own_temporary_directory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Give what the tests start a temporary directory that goes with them: viewers that are ended leave folders."""
    folder = tmp_path_factory.mktemp("tmp")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", str(folder))
        patch.setattr(tempfile, "tempdir", str(folder))
        yield
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="session", autouse=True)
def one_fit_at_a_time() -> Iterator[None]:
    """Beside other workers of pytest a search's second thread takes more time than it saves."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("torsight.core.parallel.threads.WORKERS", 1)
        yield


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real measurements that nobody of this project made; skips where it is absent."""
    folder = Path(os.environ.get("TORSIGHT_SHARED_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"real measurements are not at {folder}; set TORSIGHT_SHARED_DATA to their folder")
    return folder
