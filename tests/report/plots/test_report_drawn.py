"""The page as people open it: whole, small, from one file, in a browser with and without scripts, and on paper."""

from __future__ import annotations

import os
import re
import stat
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from browser import open_browser
from made_up_run import rewrite, write_made_up_run

from torsight.report import write_report
from torsight.report.plots.interactive import library

VOID = {"meta", "br", "hr", "img", "link", "input"}
SIZE_LIMIT = 3_000_000


class Markup(HTMLParser):
    """Fails on a tag that is closed without being open; keeps what is left open, and what is asked for."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.asked: list[str] = []
        self.stills: list[tuple[str, str]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attrs}
        if tag not in VOID:
            self.open.append(tag)
        self.asked += [found[name] for name in ("src", "srcset", "data", "action") if name in found]
        if tag in {"link", "iframe", "object"}:
            self.asked.append(tag)
        if tag == "img" and found.get("class") == "still":
            self.stills.append((found["src"], found["alt"]))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a report with everything in it, and take away the right to write to its folder."""
    folder = tmp_path_factory.mktemp("drawn")
    write_made_up_run(folder, rate_hz=10.0)
    gains = {"sensor_lag": 4000.0, "clock_offset": 3000.0}
    rewrite(folder, "discovery", evidence={"gains": gains, "best_set": []})
    path = write_report(folder)
    for one in (path, folder):
        one.chmod(one.stat().st_mode & ~(stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH))
    return path


def test_the_page_is_well_formed_small_and_asks_for_nothing(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert len(text.encode()) < SIZE_LIMIT
    checker = Markup()
    checker.feed(text)
    assert checker.open == []
    assert all(one.startswith("data:") for one in checker.asked)
    # Apart from BokehJS, which names its makers, no address stands in it but the names of XML's vocabularies.
    own = text.replace(library(), "").replace("http://www.w3.org/", "")
    assert not re.search(r"https?://|url\((?!#|%23)|@import", own)


def test_every_plot_is_also_a_picture_that_stands_for_it(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    checker = Markup()
    checker.feed(text)
    plots = re.findall(r'id="plot-([a-z_]+)"', text)
    assert len(plots) == len(checker.stills) >= 15
    for address, words in checker.stills:
        kind, _, data = address.partition(",")
        assert kind == "data:image/svg+xml"
        ET.fromstring(unquote(data))  # noqa: S314 - our own text
        assert words
    assert "<noscript>" in text


def test_the_same_results_make_the_same_bytes(page: Path, tmp_path: Path) -> None:
    # A process of its own: Bokeh counts its models, matplotlib salts its identifiers.
    folder = tmp_path / page.parent.name
    folder.mkdir()
    for path in page.parent.iterdir():
        if path.is_file() and path != page:
            (folder / path.name).write_bytes(path.read_bytes())
    words = f"from pathlib import Path; from torsight.report import write_report; write_report(Path({str(folder)!r}))"
    # A notebook's backend that is not installed here is none of the report's business.
    paths = os.environ | {"MPLBACKEND": "module://nobody_has_this", "PYTHONHASHSEED": "7"}
    subprocess.run([sys.executable, "-c", words], check=True, env=paths)
    assert (folder / "report.html").read_bytes() == page.read_bytes()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with open_browser() as found:
        yield found


def opened(browser: Any, page: Path, **options: Any) -> tuple[Any, list[str], list[str]]:
    """Open a page without a network; return it, what its console says of trouble, and what it asked for."""
    tab = browser.new_context(offline=True, viewport={"width": 1280, "height": 900}, **options).new_page()
    trouble: list[str] = []
    asked: list[str] = []
    tab.on("console", lambda one: trouble.append(one.text) if one.type in {"error", "warning"} else None)
    tab.on("pageerror", lambda error: trouble.append(str(error)))
    tab.on("request", lambda one: asked.append(one.url))
    tab.goto(page.as_uri())
    return tab, trouble, [one for one in asked if not one.startswith("data:")]


@pytest.fixture(scope="module")
def drawn(browser: Any, page: Path) -> tuple[Any, list[str], list[str], list[Path]]:
    """Return the page with all of its plots drawn, which takes seconds, what it said and asked for, and its folder."""
    left = sorted(page.parent.iterdir())
    tab, trouble, asked = opened(browser, page)
    tab.wait_for_selector("html.drawn")
    return tab, trouble, asked, left


@pytest.mark.browser
def test_the_plots_are_drawn_without_a_network_or_a_word_of_trouble(drawn: Any, page: Path) -> None:
    tab, trouble, asked, left = drawn
    assert tab.locator(".plot canvas").count() >= 15
    assert not tab.locator(".still").first.is_visible()
    assert trouble == []
    assert asked == [page.as_uri()]
    assert sorted(page.parent.iterdir()) == left
    stands_on_paper(tab)


def stands_on_paper(tab: Any) -> None:
    """Check that what is printed of a page whose plots are drawn has the pictures in their place, on white."""
    tab.emulate_media(media="print")
    assert tab.locator("#before_after .still").is_visible()
    assert not tab.locator("#before_after .plot").is_visible()
    paper = tab.evaluate("getComputedStyle(document.body).backgroundColor")
    assert paper == "rgb(255, 255, 255)"
    tab.emulate_media(media="screen")


@pytest.mark.browser
def test_the_keyboard_reaches_everything_sees_where_it_is_and_gets_past_a_plot(drawn: Any) -> None:
    tab, trouble, _, _ = drawn
    focused = """() => {
        let one = document.activeElement;
        while (one.shadowRoot?.activeElement) one = one.shadowRoot.activeElement;
        const style = getComputedStyle(one);
        return [one.getAttribute("href") ?? one.getAttribute("title") ?? one.className, style.outlineStyle];
    }"""
    tab.keyboard.press("Tab")
    assert tab.evaluate(focused)[0] == "#answer"

    def walk(steps: int, *, past: bool) -> list[tuple[str, str]]:
        seen = []
        for _ in range(steps):
            tab.keyboard.press("Tab")
            seen.append(tuple(tab.evaluate(focused)))
            if seen[-1][0] == "#motion" or (past and seen[-1][0].startswith("#past-")):
                tab.keyboard.press("Enter")
        return seen

    # The list of contents leads to the motion, each plot's first stop leads past it.
    seen = walk(10, past=True)
    names = [name for name, _ in seen]
    at = names.index("#motion")
    assert "#next" in names[:at]
    assert names[at + 1 : at + 3] == ["#past-angle_time", "#past-angle_temperature_a"]
    assert all(outline not in {"none", ""} for _, outline in seen)
    # Without the jump the tools of the plot are there, and after them the page goes on.
    tab.locator("#angle_time .links a").first.focus()
    names = [name for name, _ in walk(14, past=False)]
    assert "Zoom In" in names
    assert "#past-angle_temperature_a" in names[names.index("Zoom In") :]
    assert trouble == []


@pytest.mark.browser
def test_time_axes_move_together_and_the_keyboard_zooms(drawn: Any) -> None:
    tab, trouble, _, _ = drawn
    ranges = """() => {
        const found = {};
        for (const root of Bokeh.documents[0].roots())
            for (const plot of root.children ? root.children.map((cell) => cell[0]) : [root])
                found[plot.id] = [plot.x_range.start, plot.x_range.end, plot.x_range.id, plot.xaxis?.[0]?.axis_label];
        return Object.values(found);
    }"""
    before = tab.evaluate(ranges)
    tab.locator("#before_after [title='Zoom In']").first.focus()
    tab.keyboard.press("Enter")
    after = tab.evaluate(ranges)
    spans = [(b[2], (a[1] - a[0]) / (b[1] - b[0])) for b, a in zip(before, after, strict=True)]
    moved = {identifier for identifier, share in spans if share < 0.99}
    assert len(moved) == 1
    # The angle over time, the temperatures, the residual, sigma and the clocks follow, the others stay.
    assert sum(identifier in moved for identifier, _ in spans) >= 7
    assert sum(identifier not in moved for identifier, _ in spans) >= 7
    assert trouble == []


@pytest.mark.browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_without_scripts_the_pictures_stand_there(browser: Any, page: Path, scheme: str) -> None:
    tab, trouble, _ = opened(browser, page, java_script_enabled=False, color_scheme=scheme)
    assert tab.locator("#before_after .still").is_visible()
    assert not tab.locator("#before_after .plot").is_visible()
    assert tab.locator("noscript p").is_visible()
    assert trouble == []


@pytest.mark.browser
def test_at_night_the_plots_are_drawn_on_dark(browser: Any, page: Path) -> None:
    import cv2

    tab, _, _ = opened(browser, page, color_scheme="dark")
    tab.wait_for_selector("html.drawn")
    tab.wait_for_timeout(300)
    shot = tab.locator("#temperatures .plot").screenshot()
    picture = cv2.imdecode(np.frombuffer(shot, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    assert np.median(picture) < 60
    assert picture.max() > 150
    stands_on_paper(tab)
