"""A real browser without a screen, for tests of pages, which skip where none is installed; and requests without one."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import shutil
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
QUIET = (
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


@contextlib.contextmanager
def open_browser() -> Iterator[Any]:
    """Give a Chromium or Chrome that is installed here; ``TORSIGHT_BROWSER`` names another one."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser; it is not installed")
    program = os.environ.get("TORSIGHT_BROWSER") or next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip(f"no browser is installed: looked for {', '.join(NAMES)}; TORSIGHT_BROWSER names another one")
    # Chromium refuses its sandbox to root.
    flags = [*QUIET, *(["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else [])]
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=flags)
        try:
            yield browser
        finally:
            browser.close()


def ask(address: str, name: str, content: Any = None, *, method: str = "", **headers: str) -> tuple[int, bytes]:
    """Send one request as a program on this computer would."""
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port or 0, timeout=60.0)
    body = None if content is None else json.dumps(content)
    connection.request(method or ("GET" if content is None else "POST"), parts.path + name, body, headers)
    answer = connection.getresponse()
    told = answer.status, answer.read()
    connection.close()
    return told
