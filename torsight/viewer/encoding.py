"""A video encoder in a separate process, with pictures on standard input.

An encoder with its own threads must not run in the process that holds the results: SVT-AV1 has been observed to
deadlock when its last pictures are requested, and when run by root it gives its caller real-time priority above
everything else. Here the encoder runs without root's rights, and this process ends itself when no output appears for
LIMIT seconds.

The arguments are TARGET CODEC WIDTH HEIGHT RATE LIMIT. Every picture is the letter ``f`` and its luma, row by row, in
video levels (16 to 235); ``e`` is the end. Input that stops without an end means that the sender has gone; this process
then ends, too. An error is reported as ``{"errno": …, "message": …}`` on standard output. The file imports nothing of
Torsight, so that the interpreter starts with little more than PyAV.
"""

from __future__ import annotations

import contextlib
import faulthandler
import io
import json
import os
import signal
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np

PICTURE: Final = b"f"
END: Final = b"e"
OPTIONS: Final = {
    "libsvtav1": {"preset": "10", "crf": "38", "g": "50"},
    "libx264": {"preset": "veryfast", "crf": "26", "g": "50"},
}
GONE: Final = 3
"""Exit code when the sender ended without an end."""


def _load_everything(av: Any) -> None:
    """Encode a picture into memory, so that everything that PyAV imports on first use is loaded.

    This happens before root's rights are given up: root's environment may lie in a folder that other users cannot read.
    """
    with av.open(io.BytesIO(), "w", format="mp4") as container:
        stream = container.add_stream("mpeg4", rate=1)
        stream.width, stream.height, stream.pix_fmt = 16, 16, "yuv420p"
        picture = np.full((24, 16), 128, np.uint8)
        container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="yuv420p")))
        container.mux(stream.encode())


def report(message: str, *, errno: int | None) -> None:
    """Write an error to standard output, with its errno where the system refused."""
    json.dump({"errno": errno, "message": message}, sys.stdout)
    sys.stdout.flush()


def main(target: str, codec: str, width: int, height: int, rate_hz: int, limit_s: float) -> int:
    """Encode the pictures on standard input and return the exit code."""
    import av

    # Ctrl-C at the terminal is for the sender, which then closes this process's input.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    nowhere = Path(os.devnull).open("w")  # noqa: SIM115 - faulthandler writes there until the end
    # The encoder prints its settings on standard error unless it is limited to errors.
    os.environ.setdefault("SVT_LOG", "1")
    if hasattr(os, "sched_setscheduler"):
        # An encoder that ran within the sender may have given it real-time priority, which this process inherits.
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with Path(target).open("wb") as file:
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            _load_everything(av)
            os.seteuid(65534)  # the user without any rights, by the convention of Linux
        with av.open(file, "w", format="mp4") as container:
            stream: Any = container.add_stream(codec, rate=rate_hz, options=OPTIONS[codec])
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            colourless = np.full((height // 2, width), 128, np.uint8)
            count = 0
            while (letter := sys.stdin.buffer.read(1)) == PICTURE:
                luma = sys.stdin.buffer.read(width * height)
                if len(luma) < width * height:
                    return GONE
                picture = np.vstack([np.frombuffer(luma, np.uint8).reshape(height, width), colourless])
                frame = av.VideoFrame.from_ndarray(picture, format="yuv420p")
                frame.pts = count
                count += 1
                faulthandler.dump_traceback_later(limit_s, exit=True, file=nowhere)
                container.mux(stream.encode(frame))
                faulthandler.cancel_dump_traceback_later()
            if letter != END:
                return GONE
            faulthandler.dump_traceback_later(limit_s, exit=True, file=nowhere)
            container.mux(stream.encode())
    faulthandler.cancel_dump_traceback_later()
    return 0


if __name__ == "__main__":
    try:
        width_px, height_px, rate = (int(word) for word in sys.argv[3:6])
        code = main(sys.argv[1], sys.argv[2], width_px, height_px, rate, float(sys.argv[6]))
    except Exception as error:  # noqa: BLE001 - the sender says what it means
        number = error.errno if isinstance(error, OSError) else None
        # PyAV's errors are OSErrors, too: their numbers are FFmpeg's.
        report(str(error), errno=None if type(error).__module__.startswith("av") else number)
        code = 1
    # Exit immediately: the encoder's own clean-up no longer matters.
    os._exit(code)
