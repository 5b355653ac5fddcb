"""The recording's writer, in a separate process.

Rerun's thread that writes files ends when the disk is full, and every later call to it may block for ever: the next
flush, the next recording, the end of the program. It therefore does not run in the process that holds the results.

On standard input the process takes ``{"folder", "target", "preview"}``, the preview as from :meth:`Preview.to_json` or
null. An error is reported by :func:`torsight.viewer.encoding.report`.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path

from torsight.viewer.encoding import report
from torsight.viewer.film_preview import Preview
from torsight.viewer.recording import log_recording


def main() -> int:
    """Write the recording and return the exit code."""
    # Ctrl-C at the terminal is for the parent, which then ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    task = json.load(sys.stdin)
    preview = None if task["preview"] is None else Preview.from_json(task["preview"])
    try:
        log_recording(Path(task["folder"]), Path(task["target"]), preview)
    except OSError as error:
        report(error.strerror or f"{type(error).__name__}: {error}", errno=error.errno if error.strerror else None)
        return 1
    except Exception as error:  # noqa: BLE001 - the sender says what it means
        report(f"{type(error).__name__}: {error}", errno=None)
        return 1
    return 0


if __name__ == "__main__":
    # Exit immediately: otherwise Python would wait for Rerun's thread, which may have ended.
    os._exit(main())
