"""An LED in the film: pictures drawn here, whose LED goes on and off at frames that are known."""

import cv2
import numpy as np
import pandas as pd
import pytest

from sync import film_light_events, read_light_events
from sync.led import led_changes
from torsight.cli.sync import sync_to_folder
from torsight.core.errors import ConfigError, NoResultError

FPS = 20.0
PLACE = (31, 22)


def draw(folder, lit, *, gain=None):
    """Write pictures with an LED of three pixels' radius, some noise, and a room whose light changes."""
    rng = np.random.default_rng(3)
    folder.mkdir()
    for index, on in enumerate(lit):
        picture = np.full((60, 80), 70.0)
        cv2.circle(picture, PLACE, 3, 150.0 if on else 55.0, -1)
        picture = picture * (1.0 if gain is None else gain[index]) + rng.normal(0.0, 3.0, picture.shape)
        cv2.imwrite(str(folder / f"{index:04d}.png"), np.clip(picture, 0, 255).astype(np.uint8))
    return folder


def states(count, *changes):
    lit = np.zeros(count, dtype=bool)
    for change in changes:
        lit[change:] = ~lit[change:]
    return lit


def test_changes_are_found_beside_the_named_place_and_under_changing_light(tmp_path):
    lit = states(90, 20, 47, 71)
    film = draw(tmp_path / "film", lit, gain=np.linspace(0.8, 1.3, 90))
    events = film_light_events(film, (PLACE[0] + 3, PLACE[1] - 3), fps=FPS)
    assert events.time_s == pytest.approx(np.array([20, 47, 71]) / FPS)
    assert events.since_s == pytest.approx(np.array([19, 46, 70]) / FPS)
    assert events.goes_on.tolist() == [True, False, True]


def test_a_flicker_is_no_switching():
    time_s = np.arange(200) / 60.0
    lit = states(200, 50, 150)
    lit[100] = False
    events = led_changes(time_s, np.where(lit, 80.0, 5.0), where="LED")
    assert events.time_s == pytest.approx(time_s[[50, 150]])


def test_frames_that_could_not_be_read_widen_the_interval():
    time_s = np.delete(np.arange(100) / 10.0, np.arange(40, 52))
    events = led_changes(time_s, np.where(time_s >= 4.5, 90.0, 10.0), where="LED")
    assert events.time_s == pytest.approx([5.2])
    assert events.since_s == pytest.approx([3.9])


@pytest.mark.parametrize("lit", [np.zeros(40, dtype=bool), np.ones(40, dtype=bool)])
def test_an_led_that_never_changes(tmp_path, lit):
    film = draw(tmp_path / "film", lit)
    with pytest.raises(NoResultError, match="LED") as caught:
        film_light_events(film, PLACE, fps=FPS)
    assert caught.value.exit_code == 4


def test_a_place_outside_the_picture(tmp_path):
    film = draw(tmp_path / "film", states(5, 2))
    with pytest.raises(ConfigError, match="outside"):
        film_light_events(film, (80, 10), fps=FPS)


def write_pair(folder, *, offset_s):
    """Write angles of ten seconds of film, and a log whose switch follows the LED's changes at 2.02 s and 6.31 s."""
    film_s = np.arange(200) / FPS
    pd.DataFrame(
        {"frame": np.arange(200), "time_s": film_s, "angle_deg": 3.0, "angle_sigma_deg": 0.1, "valid": 1}
    ).to_csv(folder / "angle.csv", index=False)
    true_s = np.arange(-5.0, 20.0, 0.015)
    heat = ((true_s >= 2.02) & (true_s < 6.31)).astype(int)
    temp_c = 24.0 + 10.0 * heat
    pd.DataFrame({"time_s": true_s + offset_s, "temp_a_c": temp_c, "temp_b_c": 24.0, "heat_a": heat}).to_csv(
        folder / "temps.csv", index=False
    )
    return film_s, (film_s >= 2.02) & (film_s < 6.31)


def test_the_whole_way_from_a_film(tmp_path):
    _, lit = write_pair(tmp_path, offset_s=123.4)
    film = draw(tmp_path / "film", lit)
    settings = {"led": [PLACE[0], PLACE[1]], "drift_ppm": 0.0}
    sync_to_folder(
        tmp_path / "angle.csv", tmp_path / "temps.csv", settings=settings, out=tmp_path / "out", film=film, fps=FPS
    )
    content = pd.read_json(tmp_path / "out" / "sync.json", typ="series")
    low, high = content["offset_s"]["ci95"]
    # Two changes, each known to a frame of 50 ms and a row of 15 ms.
    assert low <= 123.4 <= high
    assert high - low < 0.05
    assert content["method"].startswith("shared event")
    table = read_light_events(tmp_path / "out" / "led_events.csv")
    assert table.goes_on.tolist() == [True, False]


@pytest.mark.parametrize("led", ["31, 22", [31], [31, "x"], [True, 3], 31])
def test_a_place_that_is_none(tmp_path, led):
    write_pair(tmp_path, offset_s=0.0)
    with pytest.raises(ConfigError, match="led"):
        sync_to_folder(
            tmp_path / "angle.csv",
            tmp_path / "temps.csv",
            settings={"led": led},
            out=tmp_path / "out",
            film=tmp_path / "film",
        )


def test_an_led_needs_its_film(tmp_path):
    write_pair(tmp_path, offset_s=0.0)
    with pytest.raises(ConfigError, match="film"):
        sync_to_folder(tmp_path / "angle.csv", tmp_path / "temps.csv", settings={"led": [3, 4]}, out=tmp_path / "out")
