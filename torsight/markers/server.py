"""Server of the page for picking markers, on a port of this computer: it ends when the page is closed.

Only requests to ``127.0.0.1`` under a path that begins with a secret of this run are answered: programs of other users
and other pages in the same browser do not know the secret.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import threading
import time
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final

from torsight.core.errors import ConfigError, NoResultError, TorsightError, reason_of, refused_by_system
from torsight.core.files.paths import LOOPBACK
from torsight.core.progress import THOUGHT_S
from torsight.markers.session import Session

PAGE: Final = Path(__file__).parent / "page.html"
_BEAT_S: Final = 0.5 * THOUGHT_S
"""Interval at which data are sent to the page, to notice within a second when it has been closed."""
_RELOAD_S: Final = 4.0 * _BEAT_S
"""A page that returns within this time was only reloaded."""
_LARGEST: Final = 100_000
"""Largest size of a request, bytes: four positions and their kinds take a hundredth of this."""


class Server(ThreadingHTTPServer):
    """Answers the page of one session, which :func:`pick` sets later: a port in use is reported before any work."""

    daemon_threads = True
    # On other systems the option lets two programs listen on one port.
    allow_reuse_address = os.name == "posix"

    session: Session

    def __init__(self, *, port: int = 0) -> None:
        self.token = secrets.token_urlsafe(16)
        self.ending = threading.Event()
        self.came = threading.Event()
        self.failed: Exception | None = None
        self._guard = threading.Lock()
        self._pages = 0
        self._left_s = 0.0
        try:
            super().__init__((LOOPBACK, port), _Handler)
        except OSError as error:
            raise ConfigError(
                f"cannot be listened on ({reason_of(error)})",
                where="--port",
                value=port,
                do="choose another port; 0 takes any that is free",
            ) from error

    @property
    def address(self) -> str:
        """Address that a browser opens."""
        return f"http://{LOOPBACK}:{self.server_address[1]}/{self.token}/"

    @contextlib.contextmanager
    def page_open(self) -> Any:
        """Count a page as open while the block lasts."""
        with self._guard:
            self._pages += 1
        self.came.set()
        try:
            yield
        finally:
            with self._guard:
                self._pages -= 1
                self._left_s = time.monotonic()

    def page_gone(self) -> bool:
        """Return whether the page was open and has been closed, not only reloaded."""
        with self._guard:
            return self.came.is_set() and self._pages == 0 and time.monotonic() - self._left_s > _RELOAD_S

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Do not report a connection that the browser has closed."""
        del request, client_address


def pick(server: Server, session: Session, *, patience_s: float, tell: Callable[[str], None]) -> dict[str, Any]:
    """Serve the page until the markers are saved or the page is closed, and return the saved content.

    ``tell`` is given the page's address as soon as it can be opened; a browser has ``patience_s`` to open it.
    """
    server.session = session
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)
    thread.start()
    try:
        tell(server.address)
        _wait(server, patience_s=patience_s)
    finally:
        server.ending.set()
        server.shutdown()
        thread.join()
    if server.failed is not None:
        raise server.failed
    if session.saved is None:
        raise NoResultError(
            "the page was closed before the markers were saved",
            where=str(session.out),
            do="run the command again and press Save on the page",
        )
    return session.saved


def _wait(server: Server, *, patience_s: float) -> None:
    until = time.monotonic() + patience_s
    while not server.ending.wait(0.1):
        if server.page_gone():
            return
        if not server.came.is_set() and time.monotonic() > until:
            raise NoResultError(
                "no browser has opened the page",
                where=server.address,
                limit=f"within {patience_s:g} s (--wait)",
                do="open the address in a browser on this computer (from another one: ssh -L "
                f"{server.server_address[1]}:{LOOPBACK}:{server.server_address[1]}), or write the file by hand with "
                "the help of --preview PICTURE.png",
            )


class _Handler(BaseHTTPRequestHandler):
    """One request of the page."""

    server: Server
    protocol_version = "HTTP/1.1"
    server_version = "torsight"
    sys_version = ""

    def do_GET(self) -> None:
        """Answer with the page, its initial state, or a picture."""
        name = self._asked()
        session = self.server.session
        if name == "":
            self._page()
        elif name == "state":
            self._answer(session.state)
        elif name == "first.png":
            self._send(session.first_png(), "image/png")
        elif name == "alive":
            self._stay()
        elif name is not None and name.startswith("check/") and name[6:].isdecimal():
            picture = session.picture(int(name[6:]))
            if picture is None:
                self._refuse(HTTPStatus.NOT_FOUND)
            else:
                self._send(picture, "image/jpeg")
        else:
            self._refuse(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        """Answer a request of the page: place, check or save."""
        name, session = self._asked(), self.server.session
        work = {"place": session.place, "check": session.check, "save": session.save}.get(name or "")
        size = self.headers.get("Content-Length", "")
        if work is None:
            self._refuse(HTTPStatus.NOT_FOUND)
        elif not size.isdecimal() or int(size) > _LARGEST:
            self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
        else:
            asked = _mapping(self.rfile.read(int(size)))
            self._answer(lambda: work(asked))

    def do_DELETE(self) -> None:
        """End: the page has shown that the markers are saved."""
        if self._asked() != "page":
            self._refuse(HTTPStatus.NOT_FOUND)
            return
        self._send(b"", "text/plain")
        self.server.ending.set()

    def _asked(self) -> str | None:
        """Return the path below the secret; None where the secret or the host is wrong."""
        host = f"{LOOPBACK}:{self.server.server_address[1]}"
        _, _, rest = self.path.partition("?")[0].partition("/")
        token, slash, name = rest.partition("/")
        same = secrets.compare_digest(token.encode(), self.server.token.encode())
        return name if same and slash and self.headers.get("Host") == host else None

    def _page(self) -> None:
        nonce = secrets.token_urlsafe(16)
        policy = (
            f"default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; img-src 'self' data:; "
            "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        text = PAGE.read_text(encoding="utf-8").replace("NONCE", nonce)
        self._send(text.encode(), "text/html; charset=utf-8", {"Content-Security-Policy": policy})

    def _answer(self, work: Callable[[], Mapping[str, Any]]) -> None:
        """Send the result of ``work``, or its error message, which the page shows."""
        try:
            content = dict(work())
        except TorsightError as error:
            content = {"error": error.what, "told": str(error)}
        except OSError as error:
            told = refused_by_system(error)
            content = {"error": told.what, "told": str(told)}
        except Exception as error:  # noqa: BLE001 - a defect of ours ends the command, which reports it
            self.server.failed = error
            self._send(json.dumps({"error": "internal error", "told": repr(error)}).encode(), "application/json")
            self.server.ending.set()
            return
        self._send(json.dumps(content, allow_nan=False).encode(), "application/json")

    def _stay(self) -> None:
        """Keep a connection open as long as the page is open."""
        self.send_response(HTTPStatus.OK)
        self._headers("text/event-stream", {"Connection": "close"})
        with self.server.page_open(), contextlib.suppress(OSError):
            while True:
                self.wfile.write(b":\n\n")
                self.wfile.flush()
                if self.server.ending.wait(_BEAT_S):
                    return

    def _send(self, data: bytes, kind: str, more: Mapping[str, str] | None = None) -> None:
        self.send_response(HTTPStatus.OK)
        self._headers(kind, {"Content-Length": str(len(data)), **(more or {})})
        with contextlib.suppress(OSError):
            self.wfile.write(data)

    def _headers(self, kind: str, more: Mapping[str, str]) -> None:
        usual = {
            "Content-Type": kind,
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
        }
        for name, value in {**usual, **more}.items():
            self.send_header(name, value)
        self.end_headers()

    def _refuse(self, status: HTTPStatus) -> None:
        self.close_connection = True
        self.send_error(status)

    def log_message(self, format: str, *arguments: Any) -> None:  # noqa: A002 - the base class names it so
        """Do not log requests: the terminal is for the user."""


def _mapping(data: bytes) -> dict[str, Any]:
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}
