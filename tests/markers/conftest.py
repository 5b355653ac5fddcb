"""A film with known markers, and a page that is served for it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import pytest

from tests.browser import open_browser
from tests.tracker.films import Rig, write_film
from torsight.markers.server import Server, pick
from torsight.markers.session import Session
from tracker.frames.source import open_source

RIG = Rig(lambda t: 60.0 - 60.0 * t, frames=24)


@pytest.fixture(scope="session")
def rig() -> Rig:
    return RIG


@pytest.fixture(scope="session")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_film(RIG, tmp_path_factory.mktemp("picked") / "film.mkv")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Return a browser; not for the whole session, as its driver keeps an event loop running in this thread."""
    with open_browser() as opened:
        yield opened


@dataclass
class Picking:
    """The command's own part, in a thread: the address it tells, and what it ends with."""

    film: Path
    out: Path
    patience_s: float = 120.0
    address: str = ""
    server: Server | None = None
    saved: dict[str, Any] | None = None
    error: Exception | None = None
    told: threading.Event = field(default_factory=threading.Event)

    def __enter__(self) -> Self:
        self.thread = threading.Thread(target=self._run)
        self.thread.start()
        assert self.told.wait(120.0)
        return self

    def __exit__(self, error: object, *_: object) -> None:
        if error is not None and self.server is not None:
            self.server.ending.set()
        self.thread.join(120.0)
        assert not self.thread.is_alive()

    def leave(self, page: Any) -> None:
        """Close the page and end at once; that a closed page ends it after a while is a test of its own."""
        page.goto("about:blank")
        assert self.server is not None
        self.server.ending.set()

    def _run(self) -> None:
        try:
            with Server() as self.server:
                session = Session(open_source(self.film), out=self.out)
                self.saved = pick(self.server, session, patience_s=self.patience_s, tell=self._tell)
        except Exception as error:  # noqa: BLE001 - a test asks for it
            self.error = error
        finally:
            self.told.set()

    def _tell(self, address: str) -> None:
        self.address = address
        self.told.set()
