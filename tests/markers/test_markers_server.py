"""What the page's server answers and to whom, and how the command ends without a browser."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from tests.browser import ask
from tests.command_line import leave
from tests.markers.conftest import Picking
from tests.tracker.films import Rig
from torsight.core.errors import NoResultError
from torsight.core.tracks import MARKERS
from tracker.detect.marker_file import read_markers


def words(address: str, name: str, content: Any) -> dict[str, Any]:
    status, data = ask(address, name, content)
    assert status == 200
    return dict(json.loads(data))


@pytest.fixture
def picks(rig: Rig) -> dict[str, Any]:
    points = dict(zip(MARKERS, rig.marker_px(60.0).tolist(), strict=True))
    return {"points": points, "kind": {"base": "dot", "moving": "dot"}}


def test_only_who_knows_the_address_is_answered(film: Path, tmp_path: Path, picks: dict[str, Any]) -> None:
    with Picking(film, tmp_path / "m.toml") as picking:
        parts = urlsplit(picking.address)
        assert parts.hostname == "127.0.0.1"
        assert len(parts.path.strip("/")) >= 20
        root = f"http://127.0.0.1:{parts.port}"
        for path in ("/", "/state", "/x/", f"/{'a' * 22}/state", parts.path.rstrip("/"), f"{parts.path}../etc/passwd"):
            assert ask(root, path)[0] == 404, path
        assert ask(root, f"/{'a' * 22}/save", picks)[0] == 404
        assert ask(root, f"/{'a' * 22}/page", method="DELETE")[0] == 404
        # A page of another site whose name was made to lead to this computer knows no secret, and names its own host.
        assert ask(picking.address, "state", Host="example.org")[0] == 404
        assert not (tmp_path / "m.toml").exists()
        status, page = ask(picking.address, "")
        assert status == 200
        assert b"NONCE" not in page
        assert not [
            word
            for word in (b"http://", b"https://", b"//cdn")
            if word in page.replace(b"http://www.w3.org/2000/svg", b"")
        ]
        assert ask(picking.address, "page", method="DELETE")[0] == 200
    assert isinstance(picking.error, NoResultError)


def test_it_listens_on_this_computer_only(film: Path, tmp_path: Path) -> None:
    with Picking(film, tmp_path / "m.toml") as picking:
        assert picking.server is not None
        assert picking.server.socket.getsockname()[0] == "127.0.0.1"
        ask(picking.address, "page", method="DELETE")


def test_what_cannot_be_saved_is_said_and_nothing_is_written(film: Path, tmp_path: Path, picks: dict[str, Any]) -> None:
    points = picks["points"]
    x, y = points["base_inner"]
    wrong = {
        "outside the picture": picks | {"points": points | {"base_outer": [-3.0, 20.0]}},
        "two markers are at one place": picks | {"points": points | {"base_outer": points["base_inner"]}},
        "no round dot": picks | {"points": points | {"moving_outer": [20.0, 20.0]}},
        "same dot as": picks | {"points": points | {"base_outer": [x + 3.0, y]}},
        "not all markers have a position": picks | {"points": {}},
        "not two positions": picks | {"points": points | {"base_outer": [1, 2, 3]}},
        "kind": picks | {"kind": {"base": "paint", "moving": "paint"}},
    }  # fmt: skip
    with Picking(film, tmp_path / "m.toml") as picking:
        for text, asked in wrong.items():
            for name in ("save", "check"):
                assert text in words(picking.address, name, asked)["told"], (text, name)
        for broken in ("{", [1], "x" * 200_000):
            status, data = ask(picking.address, "save", broken)
            assert status == 413 or b"error" in data
        assert "two numbers" in words(picking.address, "place", {"x": "1", "kind": "dot"})["told"]
        assert not (tmp_path / "m.toml").exists()
        assert "saved" in words(picking.address, "save", picks)
        ask(picking.address, "page", method="DELETE")
    assert picking.error is None
    assert read_markers(tmp_path / "m.toml").kind == "dot"
    assert picking.saved is not None
    assert set(picking.saved) == {"base", "moving", "kind"}


def test_a_browser_that_never_comes(film: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert leave("markers", film, "--out", tmp_path / "m.toml", "--no-open", "--wait", "1") == 4
    told = capsys.readouterr().err.splitlines()
    assert told[0].split()[3].startswith("http://127.0.0.1:")
    assert "no browser has opened the page" in told[-1]
    assert "ssh -L" in told[-1]
    assert not (tmp_path / "m.toml").exists()


def test_a_port_that_is_taken(film: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert leave("markers", film, "--out", tmp_path / "m.toml", "--port", port) == 2
    told = capsys.readouterr().err
    assert "--port" in told
    assert str(port) in told


def test_the_film_itself_is_not_written_over(film: Path) -> None:
    before = film.read_bytes()
    assert leave("markers", film, "--out", film) == 2
    assert leave("markers", film, "--preview", film) == 2
    assert film.read_bytes() == before


def test_a_file_that_cannot_be_written_is_told_on_the_page(film: Path, tmp_path: Path, picks: dict[str, Any]) -> None:
    (tmp_path / "m.toml").mkdir()
    with Picking(film, tmp_path / "m.toml") as picking:
        assert "m.toml" in words(picking.address, "save", picks)["told"]
        ask(picking.address, "page", method="DELETE")
    assert isinstance(picking.error, NoResultError)


def test_a_marker_file_that_is_damaged_is_said_and_replaced(film: Path, tmp_path: Path, picks: dict[str, Any]) -> None:
    (tmp_path / "m.toml").write_text("base = [[1, 2]]\n")
    with Picking(film, tmp_path / "m.toml") as picking:
        state = json.loads(ask(picking.address, "state")[1])
        assert state["earlier"] is None
        assert "cannot be used" in state["remark"]
        words(picking.address, "save", picks)
        ask(picking.address, "page", method="DELETE")
    read_markers(tmp_path / "m.toml")
