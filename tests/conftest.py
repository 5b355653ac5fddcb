"""Fixtures that all tests share."""

from __future__ import annotations

import os
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

ROOT = Path(__file__).parents[1]


class ByModule(LoadScopeScheduling):
    """Give out single tests one by one; those of a module that makes something once go to one worker together.

    The largest modules come first and single tests last, so that no worker waits for long.
    """

    def _split_scope(self, nodeid: str) -> str:
        path = nodeid.partition("::")[0]
        return path if makes_something_once(path) else nodeid


@cache
def makes_something_once(path: str) -> bool:
    """Return whether a file of tests, or its folder, has a fixture that is made once for all of them."""
    beside = [one for one in (ROOT / path, (ROOT / path).with_name("conftest.py")) if one.exists()]
    return any('scope="module"' in one.read_text(encoding="utf-8") for one in beside)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByModule:
    """Choose how tests are given to workers."""
    return ByModule(config, log)


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
