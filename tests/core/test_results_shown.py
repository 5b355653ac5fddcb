"""Results as people meet them: one line, a table in a notebook, rows, a plot."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import FrozenInstanceError, is_dataclass, replace
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from calibration import draw_board
from calibration.axis import CirclesPose, DiskPose
from calibration.boards.board_file import Board
from calibration.boards.printing import Drawing
from calibration.stage import Calibration
from calibration.views.board_views import Seen, Source
from calibration.views.detect import View
from sync import Found, LightEvents, LogReading
from sync.log.repairs import Repair, Restart
from tests.core.test_paths import public_functions
from torsight.actuator import ActuatorModel, FitResult, FittedModel, Simulation, fit_model, fitted_model, reference_spec
from torsight.actuator.characterising.characterised import Characterisation, Step
from torsight.actuator.effects import Effect, load_effects
from torsight.actuator.simulation import Prediction
from torsight.core.files.results import RunResults
from torsight.core.optics.axis import Axis
from torsight.core.optics.camera import Camera, Intrinsics, Pose
from torsight.core.parameter import Estimate
from torsight.core.records import ClockMap, SyncedTable, TemperatureLog
from torsight.core.tracks import MarkerTracks, StickAngles
from torsight.core.words.shown import Shown
from torsight.discovery import PredictedAngle, predict_with_sigma
from torsight.discovery.report import DiscoveryReport, Errors, FoundEffect
from torsight.synthetic import Record, scene_from
from tracker import Orientation, TrackResult
from tracker.detect.marker_file import MarkerHints

N = 30
TIME_S = np.linspace(0.0, 14.5, N)
ONES = np.ones(N)
LOG = TemperatureLog(TIME_S, 24.0 + TIME_S, 23.5 * ONES, extra={"room_c": 22.0 * ONES})
TABLE = SyncedTable(TIME_S, 0.1 * TIME_S, 1e-3 * ONES, 24.0 + TIME_S, 23.5 * ONES)
CLOCK = ClockMap(5.0, 20.0, (4.9, 5.1), (0.0, 40.0), "the motion")
READING = LogReading(LOG, (Repair("spike", 2, "two"),), (Restart(9, 3.0, 1.0, 0.2),), zero="2024-05-14T10:00:00")
ANGLES = StickAngles(np.arange(N), TIME_S, 0.1 * TIME_S, 1e-3 * ONES, ONES > 0, ONES > 0)
TRACKS = MarkerTracks(
    np.arange(N), TIME_S, np.full((N, 4, 2), 20.0), np.tile(np.eye(2), (N, 4, 1, 1)), np.ones((N, 4), bool), (64, 48)
)
START_RAD = 3.0
TAU = Estimate(0.79, 0.01, (0.77, 0.81), "mN·m")
CAMERA = Camera(Intrinsics((64, 48), np.diag([80.0, 80.0, 1.0]), np.zeros(5)))
POSE = Pose(np.array([np.pi, 0.0, 0.0]), np.array([0.0, 10.0, 500.0]), 3.0, 0.0)


def test_a_notebook_that_would_show_no_picture_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    with mpl.rc_context({"backend": "agg"}):
        LOG.plot()
        monkeypatch.setitem(
            sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=object()))
        )
        with pytest.warns(UserWarning, match=r"'agg', which shows nothing in a notebook.*%matplotlib inline"):
            LOG.plot()
        _, axes = plt.subplots()
        LOG.plot(axes)
    plt.close("all")


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (reference_spec(), "ActuatorSpec(reference rig, 15 values, 9 with an uncertainty)"),
        (ActuatorModel(reference_spec()), "ActuatorModel(reference rig, no effects, 10 free parameters)"),
        (
            ActuatorModel(reference_spec(), ["sensor_lag"]),
            "ActuatorModel(reference rig, sensor_lag, 12 free parameters)",
        ),
        (
            scene_from({"seed": 5, "effects": {"sensor_lag": {}}}, where="test"),
            "Scene(seed 5, sensor_lag, 2 half-cycles, 640 × 480 px at 30 frames/s)",
        ),
        (ActuatorModel(reference_spec()).prepare(TABLE), "Drive(30 rows over 14.5 s, 1 half-cycle, 23.5 to 38.5 °C)"),
        (CAMERA, "Camera(64 × 48 px, focal length 80 px, no pose)"),
        (replace(CAMERA, pose=POSE), "Camera(64 × 48 px, focal length 80 px, with its pose)"),
        (MarkerHints(np.full((4, 2), 20.0), ("tag", "dot"), "markers.toml"), "MarkerHints(markers.toml, tag and dot)"),
    ],
)
def test_what_a_fit_is_made_of_is_one_short_line(made: object, words: str) -> None:
    assert repr(made) == words


@pytest.mark.parametrize("made", [reference_spec(), LOG, TAU, ANGLES], ids=lambda one: type(one).__name__)
@pytest.mark.parametrize("name", ["theta_p_rad", "value"])
def test_a_frozen_object_says_so_and_what_to_do(made: object, name: str) -> None:
    with pytest.raises(FrozenInstanceError, match=rf"'{name}' of a frozen {type(made).__name__}.*replace"):
        setattr(made, name, 1.0)
    with pytest.raises(FrozenInstanceError, match="replace"):
        delattr(made, name)


@pytest.fixture(scope="session")
def fitted(half_cycle: SyncedTable) -> FitResult:
    model = ActuatorModel(replace(reference_spec(), uncertainty={"tau_c_mnm": 0.3}))
    return fit_model(model, model.prepare(half_cycle))


@pytest.fixture(scope="session")
def model(fitted: FitResult, half_cycle: SyncedTable) -> FittedModel:
    return fitted_model(fitted.model, fitted.values, fitted.model.prepare(half_cycle))


def discovery(model: FittedModel) -> DiscoveryReport:
    errors = Errors(0.2, 0.3, 0.99)
    return DiscoveryReport(
        verdict="identified",
        effects=(
            FoundEffect(
                "sensor_lag", "sensor", "Sensor lag", {"lag_s": Estimate(1.2, 0.1, (1.0, 1.4), "s")}, 0.9, 40.0
            ),
        ),
        alternatives=(),
        drivers=(),
        before=errors,
        after=errors,
        held_out=(0,),
        noise_floor_deg=0.1,
        parameters={"tau_c_mnm": TAU},
        plain_parameters={},
        pulls=(),
        plain_pulls=(),
        next_experiment=None,
        notes=(),
        evidence={},
        curves={"time_s": TIME_S, "angle_deg": TIME_S, "plain_deg": TIME_S, "extended_deg": TIME_S},
        model=model,
        covariance=np.eye(1),
    )


def test_a_folder_with_a_discovery_gives_the_friction_of_the_extended_model() -> None:
    plain, extended = ({"tau_c_mnm": Estimate(value, 0.01, (value, value), "mN·m").to_json()} for value in (0.36, 0.53))
    assert RunResults("results", fit={"parameters": plain}).facts()["friction torque"].startswith("0.36")
    both = RunResults("results", fit={"parameters": plain}, discovery={"parameters": extended, "verdict": "none"})
    assert both.facts()["friction torque"].startswith("0.53")


def characterisation() -> Characterisation:
    step = Step({}, 0.1, {}, {"curve": (TIME_S, TIME_S, TIME_S)})
    return Characterisation({"free_recovery": step}, "liang_rogers", {"tau_c_mnm": TAU}, reference_spec())


AXIS = Axis(POSE.tvec_mm, np.array([0.0, 0.0, -1.0]), 1e-3, np.ones(2), np.ones(2), misfit=1.1, arc_rad=2.0)
CORNERS = np.arange(8.0).reshape(4, 2)
VIEW = View("a.png", 0, np.arange(4), np.zeros((4, 3)), CORNERS, CORNERS, 2.0)


MADE: dict[type[Shown], Callable[[FitResult, FittedModel], Shown]] = {
    TemperatureLog: lambda _f, _m: LOG,
    SyncedTable: lambda _f, _m: TABLE,
    ClockMap: lambda _f, _m: CLOCK,
    MarkerTracks: lambda _f, _m: TRACKS,
    StickAngles: lambda _f, _m: ANGLES,
    LogReading: lambda _f, _m: READING,
    Found: lambda _f, _m: Found(CLOCK, READING),
    LightEvents: lambda _f, _m: LightEvents(TIME_S, TIME_S > 3.0),
    TrackResult: lambda _f, _m: TrackResult(TRACKS, np.empty(N)),
    Orientation: lambda _f, _m: Orientation(ANGLES, None, np.ones((N, 2)), {"method": "by hand"}),
    RunResults: lambda _f, _m: RunResults(
        "results", merged=TABLE.to_frame(), fit={"parameters": {"tau_c_mnm": TAU.to_json()}}
    ),
    Calibration: lambda _f, _m: Calibration(Board("charuco", 5, 7, 20.0)),
    Drawing: lambda _f, _m: draw_board(Board("chessboard", 5, 7, 20.0)),
    CirclesPose: lambda _f, _m: CirclesPose(POSE, AXIS, ("in units of the stick",)),
    DiskPose: lambda _f, _m: DiskPose(POSE, 1.1, 0.1, 0.0, 0.2, (0.0, 40.0), 0.3),
    Seen: lambda _f, _m: Seen((VIEW,), (Source("a.png", "", 0), Source("b.png", "", 1, "blurred")), (64, 48), "", 1),
    Effect: lambda _f, _m: load_effects()["sensor_lag"],
    Characterisation: lambda _f, _m: characterisation(),
    Record: lambda _f, _m: Record(TABLE, TABLE.angle_rad, None),
    FitResult: lambda fit, _m: fit,
    Simulation: lambda fit, _m: fit.simulation,
    FittedModel: lambda _f, model: model,
    DiscoveryReport: lambda _f, model: discovery(model),
    Prediction: lambda _f, model: model.predict(LOG, start_angle_rad=START_RAD),
    PredictedAngle: lambda _f, model: predict_with_sigma(model, LOG, start_angle_rad=START_RAD),
}
SERIES = (*list(MADE)[:2], MarkerTracks, StickAngles, LogReading, Found, TrackResult, Orientation, Record, FitResult)
SERIES += (Prediction, PredictedAngle)


@pytest.fixture(params=MADE, ids=lambda kind: kind.__name__)
def shown(request: pytest.FixtureRequest, fitted: FitResult, model: FittedModel) -> Shown:
    return MADE[request.param](fitted, model)


def test_one_line_and_a_summary_say_the_facts(shown: Shown) -> None:
    line, summary = repr(shown), shown.summary()
    assert line.startswith(f"{type(shown).__name__}(")
    assert "\n" not in line
    assert len(line) < 400
    assert "array(" not in line + summary
    assert len(summary.splitlines()) == 1 + len(shown.facts())
    page = shown._repr_html_()
    assert page.startswith("<table>")
    assert page.count("<tr>") == len(shown.facts())


def test_rows_and_a_plot(shown: Shown) -> None:
    frame = shown.to_frame()
    if isinstance(shown, SERIES):
        assert np.all(np.diff(frame["time_s"]) > 0)
        assert len(frame) >= N
    figure, axes = plt.subplots()
    assert shown.plot(axes) is axes
    assert axes.get_xlabel()
    assert axes.get_ylabel()
    plt.close(figure)


def test_a_plot_without_axes_makes_its_own_with_a_backend_that_has_no_screen() -> None:
    with mpl.rc_context({"backend": "Agg"}):
        axes = LOG.plot()
    assert isinstance(axes, Axes)
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), LOG.temp_a_c)
    plt.close(axes.figure)


def test_a_backend_that_is_not_there_is_named_and_axes_of_ones_own_need_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "module://notebook_of_nobody.backend_inline")
    code = (
        "import numpy as np\nfrom matplotlib.figure import Figure\nfrom torsight.core import TemperatureLog\n"
        "log = TemperatureLog(np.arange(3.0), np.arange(3.0), np.arange(3.0))\n"
        "print(len(log.plot(Figure().subplots()).lines))\nlog.plot()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout == "2\n"
    told = done.stderr.splitlines()[-1]
    assert "ConfigError: MPLBACKEND" in told
    assert "No module named 'notebook_of_nobody'" in told
    assert "matplotlib-inline" in told


def test_tables_are_in_the_units_of_files() -> None:
    frame = TABLE.to_frame()
    np.testing.assert_allclose(frame["angle_deg"], np.rad2deg(TABLE.angle_rad))
    assert "room_c" in LOG.to_frame()
    np.testing.assert_allclose(Found(CLOCK, READING).to_frame()["time_s"], CLOCK.to_film_time(TIME_S))


def test_a_poses_plot_shows_the_axis_from_its_origin_towards_the_camera_and_a_boards_its_corners() -> None:
    figure, (side, page) = plt.subplots(1, 2)
    toward = replace(POSE, rvec=np.array([0.0, np.pi, 0.0]))
    axis = DiskPose(toward, 1.1, 0.1, 0.0, 0.2, (0.0,), 0.3).plot(side).lines[1]
    distance = float(np.linalg.norm(POSE.tvec_mm))
    np.testing.assert_allclose(axis.get_xdata(), [500.0, 500.0 - distance / 4.0])
    board = draw_board(Board("chessboard", 5, 7, 20.0))
    board.plot(page)
    drawn = page.patches[0].get_path().vertices
    frame = board.to_frame()
    assert len(drawn) == 5 * len(frame)
    assert drawn[:, 0].max() == pytest.approx((frame["x_mm"] + frame["width_mm"]).max())
    plt.close(figure)


def test_markup_in_a_fact_is_text() -> None:
    assert "&lt;b&gt;" in replace(CLOCK, method="<b>")._repr_html_()


def results() -> Iterator[type]:
    """Give the dataclasses that public functions return, alone or in a tuple."""
    for _, function in public_functions():
        for name in re.findall(r"[A-Z]\w+", str(inspect.signature(function).return_annotation)):
            found = function.__globals__.get(name)
            if inspect.isclass(found) and is_dataclass(found):
                yield found


def test_every_result_of_a_public_function_shows_itself() -> None:
    # What a person wrote, and cameras, are inputs; the engine's own results are the engine's to show.
    inputs = {"ActuatorSpec", "Board", "Camera", "MarkerHints", "Scene", "SpringTests", "ClosedForm", "LinearProblem"}
    inputs |= {"Parameter", "Candidate", "ModelProblem", "LawPort", "Ode"}
    assert {one.__name__ for one in results() if not issubclass(one, Shown)} <= inputs


def test_values_that_a_record_does_not_determine_are_noted(model: FittedModel) -> None:
    explained = replace(discovery(model), evidence={"over_floor_after": 1.0})
    assert "does not determine the model's values" in explained.to_json()["notes"][0]
    assert replace(explained, noise_floor_deg=0.2).to_json()["notes"] == []
