"""Fixtures that all tests share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

# No test depends on how fast a machine is.
settings.register_profile("torsight", deadline=None)
settings.load_profile("torsight")

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real measurements that nobody of this project made; skips where it is absent."""
    folder = Path(os.environ.get("TORSIGHT_SHARED_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"real measurements are not at {folder}; set TORSIGHT_SHARED_DATA to their folder")
    return folder
