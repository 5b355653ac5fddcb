"""The viewer's program: its path, and its start so that it listens on this computer only."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final
from urllib.parse import quote

from torsight.core.errors import ConfigError, NoResultError
from torsight.core.files.paths import LOOPBACK
from torsight.core.progress import THOUGHT_S

_TROUBLE: Final = (
    "panicked at",
    "no graphics adapter",
    "adapter was found",
    "winit",
    "display",
    "address already in use",
)
"""Phrases in the viewer's own messages on a failed start."""
_END_S: Final = 3.0 * THOUGHT_S
"""Time in which the viewer ends after it was asked to, or could not draw: a choice; then it is killed."""


def viewer_program() -> Path:
    """Return the viewer's own binary; the script of that name is a wrapper that does not forward signals to end."""
    found = importlib.util.find_spec("rerun_cli")
    places = [] if found is None else [Path(place) for place in found.submodule_search_locations or []]
    for place in places:
        for name in ("rerun", "rerun.exe"):
            if (place / name).exists():
                return place / name
    raise NoResultError("the Rerun viewer is not installed", do="install it with: pip install rerun-sdk")


def free_port() -> int:
    """Return a port of this computer that nothing listens on."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def chosen_port(wanted: int | None, usual: int, *, option: str) -> int:
    """Return the port that was asked for (0: any free one), else the default port if it is free, else any."""
    if wanted == 0:
        return free_port()
    port = usual if wanted is None else wanted
    with socket.socket() as probe, contextlib.suppress(OSError):
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind((LOOPBACK, port))
        return port
    if wanted is None:
        return free_port()
    raise ConfigError("is taken by another program", where=option, value=wanted, do="choose another port; 0 takes any")


def address_of(port: int) -> str:
    """Return the address that a viewer opens for a server at a port of this computer."""
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def browser_address(web_port: int, address: str) -> str:
    """Return the URL for a browser: the viewer's page at a port, showing the data served at an address."""
    return f"http://{LOOPBACK}:{web_port}?url={quote(address, safe='')}"


def has_display() -> bool:
    """Return whether a window can be opened here."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def step_back(process: int = 0) -> None:
    """Lower the priority of a process (by its id; 0: this one), so that it never delays the measurement."""
    # Beside a process of ordinary niceness it gets a tenth of a processor (Linux weighs 110 against 1024).
    if hasattr(os, "setpriority"):
        os.setpriority(os.PRIO_PROCESS, process, 10)


class Viewer:
    """A viewer process of this program; its output goes to a file, so that the viewer never waits for a reader.

    A viewer that ``stays`` outlives this program, and removes its own temporary folders. A ``quiet`` viewer shows no
    notices over its panes, such as that it runs without a screen: notices are log messages, and it logs errors only.
    """

    def __init__(self, arguments: Sequence[str], *, port: int, stays: bool = False, quiet: bool = False) -> None:
        self.port = port
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the viewer
        # The viewer leaves its folders for temporary files where it ends early, as without a graphics driver.
        self._folder = None if stays else tempfile.TemporaryDirectory(prefix="torsight-viewer-")
        places = {} if self._folder is None else dict.fromkeys(("TMPDIR", "TEMP", "TMP"), self._folder.name)
        command = [str(viewer_program()), "--bind", LOOPBACK, "--port", str(port), *arguments]
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._said,
            text=True,
            env=os.environ | places | ({"RUST_LOG": "error"} if quiet else {}),
        )
        step_back(self.process.pid)

    @property
    def running(self) -> bool:
        """Whether the viewer has not ended yet."""
        return self.process.poll() is None

    def wait(self) -> int:
        """Wait until the viewer ends and return its exit code."""
        return self.process.wait()

    def ends(self) -> bool:
        """Wait briefly for the viewer to end, and return whether it has ended."""
        try:
            self.process.wait(timeout=_END_S)
        except subprocess.TimeoutExpired:
            return False
        return True

    def why_ended(self) -> str:
        """Return the viewer's error message, else its last line of output."""
        self._said.seek(0)
        lines = [line.strip() for line in self._said.read().decode("utf-8", "replace").splitlines() if line.strip()]
        trouble = [line for line in lines if any(word in line.lower() for word in _TROUBLE)]
        return (trouble or lines[-1:] or [f"exit code {self.process.returncode}"])[0][:300]

    def end(self) -> None:
        """End the viewer, wait for it, and remove its output and temporary folder."""
        if self.running:
            self.process.terminate()
            if not self.ends():
                self.process.kill()
        self.process.wait()
        self._said.close()
        if self._folder is not None:
            self._folder.cleanup()
