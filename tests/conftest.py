"""Fixtures that all tests share."""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

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


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep tests that share what their module makes once on one worker: it is not made twice.

    ``--dist loadgroup`` gives out the largest groups first and single tests last, so that no worker waits for long.
    """
    for item in items:
        assert isinstance(item, pytest.Function)
        used = [definition for found in item._fixtureinfo.name2fixturedefs.values() for definition in found]
        if any(definition.scope == "module" for definition in used):
            item.add_marker(pytest.mark.xdist_group(item.nodeid.partition("::")[0]))


@pytest.fixture(scope="session", autouse=True)
def own_temporary_directory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Give what the tests start a temporary directory that goes with them: viewers that are ended leave folders."""
    folder = tmp_path_factory.mktemp("tmp")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", str(folder))
        patch.setattr(tempfile, "tempdir", str(folder))
        yield
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real measurements that nobody of this project made; skips where it is absent."""
    folder = Path(os.environ.get("TORSIGHT_SHARED_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"real measurements are not at {folder}; set TORSIGHT_SHARED_DATA to their folder")
    return folder
