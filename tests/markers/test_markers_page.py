"""The page for picking markers, in a real browser: clicks, keys, zoom, the check, what is refused, and how it ends."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.markers.conftest import Picking
from tests.tracker.films import Rig, write_film
from torsight.core.errors import NoResultError
from torsight.core.tracks import MARKERS
from tracker.detect.marker_file import read_markers

pytestmark = pytest.mark.browser

ROOT = Path(__file__).parents[2]
CENTRE_PX = 0.05
"""Error allowed: seven times the Cramér-Rao bound of a dot in these films (1.06 · 2 / 140 · √(1 / 5) = 0.007 px)."""


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    """Return an empty page; every word of its console fails the test."""
    opened = browser.new_page(viewport={"width": 1200, "height": 800})
    heard: list[str] = []
    opened.on("console", lambda message: heard.append(message.text))
    opened.on("pageerror", lambda error: heard.append(str(error)))
    yield opened
    opened.close()
    assert not heard


def load(page: Any, address: str) -> None:
    page.goto(address)
    page.wait_for_selector("#frame img")


def on_screen(page: Any, at: np.ndarray) -> tuple[float, float]:
    """Return where a place of the picture is on the screen: from the picture's own box, however it is zoomed."""
    box = page.locator("#frame img").bounding_box()
    scale = box["width"] / page.evaluate("state.width")
    return box["x"] + (at[0] + 0.5) * scale, box["y"] + (at[1] + 0.5) * scale


def saved_px(path: Path) -> np.ndarray:
    return read_markers(path).position_px


def test_four_clicks_a_check_and_a_file(page: Any, film: Path, rig: Rig, tmp_path: Path) -> None:
    truth = rig.marker_px(60.0)
    with Picking(film, tmp_path / "markers.toml") as picking:
        load(page, picking.address)
        page.click("#clear")
        assert page.is_disabled("#save")
        for number, place in enumerate(truth):
            assert MARKERS[number].replace("_", " ") in page.inner_text("#told")
            # Two pixels beside the middle: the pick comes to lie on the dot's centre.
            page.mouse.click(*on_screen(page, place + np.array([1.4, -1.4])))
            page.wait_for_selector(f"#overlay g[data-marker={MARKERS[number]}]", state="attached")
        page.click("#check")
        page.wait_for_selector("#player:not([hidden])")
        assert page.inner_text("#verdict").startswith("24 of 24 frames")
        page.click("#play")
        page.locator("#scrub").fill("23")
        angle = re.search(r"([-\d.]+)°", page.inner_text("#moment"))
        assert angle is not None
        assert float(angle[1]) == pytest.approx(float(rig.truth_deg[-1]), abs=0.2)
        page.click("#save")
        page.wait_for_selector("#done[open]")
    assert picking.error is None
    np.testing.assert_allclose(saved_px(tmp_path / "markers.toml"), truth, atol=CENTRE_PX)


def test_what_was_found_is_there_at_once(page: Any, film: Path, rig: Rig, tmp_path: Path) -> None:
    with Picking(film, tmp_path / "markers.toml") as picking:
        load(page, picking.address)
        assert "found automatically" in page.inner_text("#told")
        page.click("#save")
        page.wait_for_selector("#done[open]")
    np.testing.assert_allclose(saved_px(tmp_path / "markers.toml"), rig.marker_px(60.0), atol=CENTRE_PX)


def test_a_click_outside_and_two_on_one_point_are_refused(page: Any, film: Path, rig: Rig, tmp_path: Path) -> None:
    truth = rig.marker_px(60.0)
    with Picking(film, tmp_path / "markers.toml") as picking:
        load(page, picking.address)
        page.click("#clear")
        page.mouse.click(*on_screen(page, np.array([160.0, -9.0])))
        page.wait_for_selector("#told.bad")
        assert "outside the picture" in page.inner_text("#told")
        page.mouse.click(*on_screen(page, truth[0]))
        page.wait_for_selector("#overlay g[data-marker=base_inner]", state="attached")
        page.mouse.click(*on_screen(page, truth[0] + 1.0))
        page.wait_for_selector("#told.bad")
        assert "the point of the base inner marker" in page.inner_text("#told")
        page.mouse.click(*on_screen(page, np.array([20.0, 20.0])))
        page.wait_for_selector("#told.bad:has-text('no round dot')")
        assert page.locator("#overlay g").count() == 1
        assert page.is_disabled("#save")
        picking.leave(page)
    assert not (tmp_path / "markers.toml").exists()


def test_exchanged_sticks_are_told_by_the_check(page: Any, film: Path, rig: Rig, tmp_path: Path) -> None:
    with Picking(film, tmp_path / "markers.toml") as picking:
        load(page, picking.address)
        page.click("#exchange")
        page.click("#check")
        page.wait_for_selector("#player:not([hidden])")
        assert "exchange base and moving" in page.inner_text("#verdict")
        page.click("#exchange")
        page.click("#save")
        page.wait_for_selector("#done[open]")
    np.testing.assert_allclose(saved_px(tmp_path / "markers.toml"), rig.marker_px(60.0), atol=CENTRE_PX)


def test_everything_by_keyboard_and_zoomed(page: Any, film: Path, rig: Rig, tmp_path: Path) -> None:
    truth = np.rint(rig.marker_px(60.0)).astype(int)
    with Picking(film, tmp_path / "markers.toml") as picking:
        load(page, picking.address)
        page.focus("#clear")
        page.keyboard.press("Enter")
        page.focus("#stage")
        before = page.locator("#frame img").bounding_box()["width"]
        page.keyboard.press("+")
        assert page.locator("#frame img").bounding_box()["width"] == pytest.approx(1.25 * before, rel=1e-3)
        # The cross begins in the middle of the picture, between two pixels.
        at = np.array([159.5, 119.5])
        for number, place in enumerate(truth):
            for axis, keys in enumerate((("ArrowLeft", "ArrowRight"), ("ArrowUp", "ArrowDown"))):
                tens, ones = divmod(abs(int(place[axis] - at[axis])), 10)
                key = keys[int(place[axis] > at[axis])]
                for _ in range(tens):
                    page.keyboard.press(f"Shift+{key}")
                for _ in range(ones):
                    page.keyboard.press(key)
                at[axis] += np.sign(place[axis] - at[axis]) * (10 * tens + ones)
            page.keyboard.press("Enter")
            page.wait_for_selector(f"#overlay g[data-marker={MARKERS[number]}]", state="attached")
        page.focus("#save")
        page.keyboard.press("Enter")
        page.wait_for_selector("#done[open]")
    np.testing.assert_allclose(saved_px(tmp_path / "markers.toml"), rig.marker_px(60.0), atol=CENTRE_PX)


def test_every_control_is_reached_by_tab(page: Any, film: Path, tmp_path: Path) -> None:
    with Picking(film, tmp_path / "markers.toml") as picking:
        load(page, picking.address)
        seen = "[...document.querySelectorAll('button, select, input')].filter(e => e.offsetParent && !e.disabled)"
        wanted = set(page.evaluate(f"{seen}.map(e => e.id)"))
        reached = set()
        for _ in range(2 * len(wanted)):
            page.keyboard.press("Tab")
            reached.add(page.evaluate("document.activeElement.id"))
        assert wanted | {"stage"} <= reached
        picking.leave(page)


def test_points_without_dots_are_taken_where_they_are_picked(page: Any, film: Path, rig: Rig, tmp_path: Path) -> None:
    picked = rig.marker_px(60.0) + np.array([2.0, 1.0])
    with Picking(film, tmp_path / "markers.toml") as picking:
        load(page, picking.address)
        page.click("#clear")
        page.select_option("#kind-base", "texture")
        page.select_option("#kind-moving", "texture")
        for number, place in enumerate(picked):
            page.mouse.click(*on_screen(page, place))
            page.wait_for_selector(f"#overlay g[data-marker={MARKERS[number]}]", state="attached")
        page.click("#save")
        page.wait_for_selector("#done[open]")
    hints = read_markers(tmp_path / "markers.toml")
    assert hints.kind == "texture"
    # A click is at a whole pixel of the screen, which shows one of the film by more than two.
    np.testing.assert_allclose(hints.position_px, picked, atol=0.5)


def test_a_page_that_is_loaded_again_goes_on_and_one_that_is_closed_ends(page: Any, film: Path, tmp_path: Path) -> None:
    with Picking(film, tmp_path / "markers.toml") as picking:
        load(page, picking.address)
        page.reload()
        page.wait_for_selector("#frame img")
        assert page.is_enabled("#save")
        page.goto("about:blank")
    assert isinstance(picking.error, NoResultError)
    assert "closed before" in str(picking.error)


def test_the_command_from_its_start_to_its_end(page: Any, tmp_path: Path) -> None:
    write_film(Rig(lambda t: 60.0 - 60.0 * t, frames=6), tmp_path / "film.mkv")
    (tmp_path / "markers.toml").write_text(
        "base = [[100, 100], [50, 50]]\nmoving = [[10, 10], [60, 90]]\nbase_mm = 40.0\n"
    )
    command = [sys.executable, "-m", "torsight.cli.main", "markers", "film.mkv", "--no-open", "--json"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as running:
        assert running.stderr is not None
        load(page, running.stderr.readline().split()[3])
        assert "markers.toml" in page.inner_text("#told")
        assert "100.0, 100.0" in page.inner_text("#point-base_inner")
        page.click("#use-found")
        page.click("#save")
        page.wait_for_selector("#done[open]")
        answer, said = running.communicate(timeout=60)
    assert running.returncode == 0, said
    assert '"base_mm": 40.0' in answer
    assert read_markers(tmp_path / "markers.toml").length_mm == {"base": 40.0}
