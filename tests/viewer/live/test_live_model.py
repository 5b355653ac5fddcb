"""The model beside a live record: what goes into its process and what comes back."""

from __future__ import annotations

import math
import multiprocessing
import time

import numpy as np
import pytest

from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec, read_actuator
from torsight.core.records import SyncedTable
from torsight.viewer.live.measure.model_watch import STEP_S, ModelWatch, model_of

ACTUATOR = """
[geometry]
wire_diameter_mm = 0.5
wire_length_mm = 64.1
[material]
E_A_gpa = 60
E_M_gpa = 20
E_S_gpa = 5
A_s_c = 36
A_f_c = 54
M_s_c = 42
M_f_c = 28
C_A_mpa_per_k = 32
C_M_mpa_per_k = 32
theta_cr_deg = 180
[assembly]
theta_p_deg = 1080
[friction]
tau_c_mnm = 0.79
[uncertainty]
tau_c_mnm = 0.3
"""


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> ActuatorSpec:
    path = tmp_path_factory.mktemp("rig") / "actuator.toml"
    path.write_text(ACTUATOR, encoding="utf-8")
    return read_actuator(path)


def temperatures(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return temperatures: A is heated for a minute and cools for one, then B; both end where they began."""

    def pulse(t: np.ndarray) -> np.ndarray:
        return 25.0 + 53.0 * np.interp(t, [0.0, 60.0, 120.0], [0.0, 1.0, 0.0])

    return pulse(time_s), pulse(time_s - 120.0)


@pytest.fixture(scope="module")
def columns(spec: ActuatorSpec) -> tuple[np.ndarray, ...]:
    """Return a record of 240 s that the rig itself made, from its place of rest."""
    time_s = (np.arange(1200) + 0.5) * STEP_S
    temp_a, temp_b = temperatures(time_s)
    angle = np.full(len(time_s), math.radians(177.6))
    sigma = np.full(len(time_s), math.radians(0.05))
    table = SyncedTable(time_s, angle, sigma, temp_a, temp_b)
    model = ActuatorModel(spec)
    drive = model.prepare(table)
    made = model.simulate(drive)
    nothing = np.full(len(time_s), np.nan)
    return time_s, np.interp(time_s, drive.time_s, made.angle_rad), sigma, temp_a, temp_b, nothing, nothing


def test_a_record_of_the_rig_itself_leaves_no_residual_and_counts_its_half_cycles(
    spec: ActuatorSpec, columns: tuple[np.ndarray, ...]
) -> None:
    news = model_of(spec, columns, None, friction=False)
    assert news.trouble == ""
    assert [begin.spring for begin in news.half_cycles] == ["A", "B"]
    # The model takes B's heating to begin when its own temperature does.
    assert news.half_cycles[1].time_s == pytest.approx(120.0, abs=5.0)
    # The reference rig turns by 466 degrees; what is left is the interpolation between rows.
    assert np.ptp(news.angle_rad) > math.radians(400.0)
    assert np.nanmax(np.abs(news.residual_rad)) < math.radians(0.5)


def test_the_residual_is_measured_less_modelled(spec: ActuatorSpec, columns: tuple[np.ndarray, ...]) -> None:
    time_s, angle, *rest = columns
    shifted = angle + np.where(time_s > 100.0, math.radians(5.0), 0.0)
    news = model_of(spec, (time_s, shifted, *rest), None, friction=False)
    late = news.time_s > 101.0
    assert np.nanmedian(news.residual_rad[late]) == pytest.approx(math.radians(5.0), abs=math.radians(0.2))


def test_a_record_in_which_nothing_is_heated_says_so(spec: ActuatorSpec, columns: tuple[np.ndarray, ...]) -> None:
    time_s, angle, sigma, temp_a, _, *rest = columns
    news = model_of(
        spec,
        (time_s, angle, sigma, np.full_like(temp_a, 25.0), np.full_like(temp_a, 25.0), *rest),
        None,
        friction=False,
    )
    assert news.trouble
    assert len(news.time_s) == 0


@pytest.fixture
def watch(spec: ActuatorSpec, columns: tuple[np.ndarray, ...]) -> ModelWatch:
    one = ModelWatch(spec)
    time_s, angle, sigma, temp_a, temp_b, *_ = columns
    for k in range(600):
        one.angle(time_s[k], angle[k], sigma[k])
        one.temperature(time_s[k], (temp_a[k], temp_b[k], math.nan, math.nan))
    return one


def test_news_come_once_from_a_process_of_its_own(watch: ModelWatch, columns: tuple[np.ndarray, ...]) -> None:
    try:
        news = first_news(watch)
        assert len(news.time_s) > 100
        assert news.time_s[-1] <= columns[0][600]
        time_s, angle, sigma, temp_a, temp_b, *_ = columns
        for k in range(600, 700):
            watch.angle(time_s[k], angle[k], sigma[k])
            watch.temperature(time_s[k], (temp_a[k], temp_b[k], math.nan, math.nan))
        later = first_news(watch)
        assert later.time_s[0] > news.time_s[-1]
    finally:
        watch.close()


def test_a_record_without_a_fit_says_why(spec: ActuatorSpec) -> None:
    one = ModelWatch(spec)
    try:
        assert one.last(1.0) == []
        assert "of the record have both an angle and temperatures" in one.why_no_fit()
    finally:
        one.close()


def test_a_model_whose_process_is_killed_only_ends_the_model(watch: ModelWatch) -> None:
    try:
        first_news(watch)
        for process in multiprocessing.active_children():
            # Other tests may have left workers of their own.
            if "Loky" not in process.name:
                process.kill()
                process.join()
        watch.angle(1000.0, 0.0, 0.01)
        watch.temperature(1000.0, (25.0, 25.0, math.nan, math.nan))
        end = time.monotonic() + 30.0
        while not watch.broken and time.monotonic() < end:
            watch.angle(time.monotonic(), 0.0, 0.01)
            watch.temperature(time.monotonic(), (25.0, 25.0, math.nan, math.nan))
            watch.poll()
            time.sleep(0.05)
        assert watch.broken
        assert watch.poll() is None
    finally:
        watch.close()


def first_news(watch: ModelWatch) -> object:
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        news = watch.poll()
        if news is not None:
            return news
        time.sleep(0.05)
    pytest.fail("no news within a minute")
