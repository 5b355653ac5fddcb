"""``torsight view``: what the command does besides opening the viewer."""

from __future__ import annotations

import signal
import sys
import time
from pathlib import Path

import pytest

from tests.command_line import leave
from torsight.cli.main import main
from torsight.viewer import program


class SlowViewer:
    """A viewer that takes its time to end, longer than the process waits before it asks itself again."""

    def __init__(self, arguments: list[str], *, port: int) -> None:
        del arguments, port
        self.open = True

    def wait(self) -> int:
        signal.raise_signal(signal.SIGINT)
        raise AssertionError("Ctrl-C went by")

    def end(self) -> None:
        time.sleep(0.3)
        self.open = False


def test_a_time_that_the_record_does_not_hold_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "recording.rrd").touch()
    (tmp_path / "angle.csv").write_text("time_s\n1\n61.5\n")
    for words in ((str(tmp_path),), (str(tmp_path / "recording.rrd"),)):
        assert leave("view", *words, "--pictures", str(tmp_path / "p"), "--at", "1e9") == 2
        assert "--at: is no time of the record; found 1000000000 s; allowed 1 to 61.5 s" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_ends_it_well_however_long_the_viewer_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    started: list[SlowViewer] = []

    def start(arguments: list[str], *, port: int) -> SlowViewer:
        started.append(SlowViewer(arguments, port=port))
        return started[-1]

    monkeypatch.setattr(program, "Viewer", start)
    (tmp_path / "recording.rrd").touch()
    with pytest.raises(SystemExit) as left:
        main(["view", str(tmp_path), "--serve", "--web-port", "0"])
    assert left.value.code == 0
    assert [viewer.open for viewer in started] == [False]
    assert "interrupted" not in capsys.readouterr().err
