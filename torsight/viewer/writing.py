"""The recording's writer, in a separate process.

Rerun's thread that writes files ends when the disk is full, and every later call to it may block for ever: the next
flush, the next recording, the end of the program. It therefore does not run in the process that holds the results.

On standard input the process takes the arguments of :func:`~torsight.viewer.recording.log_recording`, pickled. An error
is reported by :func:`torsight.viewer.encoding.report`.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys

from torsight.viewer.encoding import report
from torsight.viewer.recording import log_recording


def main() -> int:
    """Write the recording and return the exit code."""
    # Ctrl-C at the terminal is for the parent, which then ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        log_recording(*pickle.load(sys.stdin.buffer))  # noqa: S301 - from the process that has started this one
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
