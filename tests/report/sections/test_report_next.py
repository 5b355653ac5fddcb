"""What to do next: the sentences follow the numbers, also where effects were named."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made_up_run import discovery, parameter, rewrite, write_made_up_run
from markupsafe import Markup
from report_words import words_of

from torsight.actuator.doubt import Doubt
from torsight.actuator.fitted import FittedModel, write_model
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import reference_spec
from torsight.core.files.results import read_results
from torsight.report.sections.next_steps import Step, next_steps

AFTER = {"rmse_train_deg": 0.05, "rmse_held_out_deg": 0.08, "r2_held_out": 0.99999}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    write_made_up_run(tmp_path, rate_hz=1.0)
    return tmp_path


def steps(folder: Path, **changes: object) -> dict[str, Step]:
    """Return the steps by their questions' first words, after changes to the answer."""
    rewrite(folder, "discovery", **changes)
    return {step.question.split()[0]: step for step in next_steps(read_results(folder))}


def test_what_the_film_makes_of_the_floor_is_told_from_what_the_temperatures_make(run: Path) -> None:
    # The made-up sigma is 0.06° throughout: all of a floor of 0.06°, a ninth of the square of one of 0.18°.
    film = steps(run, after=AFTER)["What"].answer
    assert "share of the angle's readings is 0.060°, the greater part" in film.unescape()
    assert "lower CRF" in film
    heat = steps(run, after=AFTER, noise_floor_deg=0.18)["What"].answer
    assert "the rest comes from the temperatures" in heat
    assert "lower CRF" not in heat


def test_a_record_that_is_not_explained_is_the_first_thing_said_and_not_to_be_trusted(run: Path) -> None:
    # The noise floor is 0.06°.
    found = steps(run, after=AFTER | {"rmse_held_out_deg": 0.44})
    assert found["Can"].good is False
    assert "the record is not explained" in found["Can"].answer
    assert "The model, not the measurement: the residual is 7.33 times the noise floor" in found["What"].answer
    (first,) = re.findall(r"<h1>(.*?)</h1>", words_of(run))
    assert first.startswith("This record is not explained: the residual is 7.33 times the noise floor")
    assert first.index("not explained") < first.index("sensor lag")


@pytest.mark.parametrize(("left", "unseen_deg"), [(2.04, 0.11), (1.9, 0.14), (0.9, 0.08)])
def test_headline_badge_trust_and_limit_ask_one_measure_what_is_explained(
    run: Path, left: float, unseen_deg: float
) -> None:
    # What the engine says is left, and the error on unseen half-cycles, may lie on either side of twice the floor.
    found = steps(run, evidence={"over_floor_after": left}, after=AFTER | {"rmse_held_out_deg": unseen_deg})
    text, doubted = words_of(run), left > 2.0
    (badge,) = re.findall(r'<span class="verdict[^"]*">(.*?)</span>', text)
    (headline,) = re.findall(r"<h1>(.*?)</h1>", text)
    assert ("not explained" in headline) is doubted
    assert ("not explained" in badge) is doubted
    assert found["Can"].good is not doubted
    assert ("not explained" in found["Can"].answer) is doubted
    assert found["What"].answer.startswith("The model") is doubted
    assert found["What"].answer.startswith("How well this record determines the values") is (left == 1.9)


def test_a_programme_that_separates_nothing_is_not_recommended(run: Path) -> None:
    ambiguous = {"verdict": "ambiguous", "alternatives": [["fatigue"]], "after": AFTER}
    for gain, words in ((9.0, "Run the one proposed below."), (0.1, "measure directly in what they differ.")):
        plan = {"text": "Hold.", "separation_gain": gain, "needed_gain": 5.9}
        assert steps(run, next_experiment=plan, **ambiguous)["What"].answer.endswith(words)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"verdict": "unknown", "effects": []}, "a measured law stands in"),
        ({"verdict": "ambiguous", "alternatives": [["fatigue"]]}, "it is not known which explanation is right"),
        ({"after": AFTER | {"rmse_held_out_deg": None}}, "no half-cycle could be held out"),
    ],
)
def test_what_speaks_against_control_is_named(run: Path, changes: dict[str, object], words: str) -> None:
    control = steps(run, **({"after": AFTER} | changes))["Can"]
    assert control.good is False
    assert words in control.answer


def test_an_explained_record_may_be_trusted_within_two_of_its_errors(run: Path) -> None:
    control = steps(run, after=AFTER)["Can"]
    assert control.good is True
    angle = pd.read_csv(run / "angle.csv")["angle_deg"]
    assert "within about ±0.16° (two sigmas)" in control.answer
    assert f"{100.0 * 0.08 / np.ptp(angle.dropna()):.3f} % of the {np.ptp(angle.dropna()):.0f}° range" in control.answer


@pytest.mark.parametrize("sigmas", [0.5, 3.0])
def test_a_predicted_sigma_is_judged_by_what_is_left_on_the_record_s_own_clocks(run: Path, sigmas: float) -> None:
    """A prediction is on its log's clock: where the camera's is elsewhere, the measured angles are no measure of it."""
    predicted_with(run, sigma_deg=0.12, left_deg=sigmas * 0.12)
    control, good = steps(run, after=AFTER)["Can"], sigmas < 2.0
    assert f"{100 if good else 0} % of the measured angles lie within two of it" in control.answer
    assert ("the predicted sigma is too small" in control.answer) is not good
    assert control.good is good


def test_a_record_that_leaves_the_values_open_is_not_recommended_for_control(run: Path) -> None:
    predicted_with(run, sigma_deg=0.5, left_deg=0.08)
    control = steps(run, after=AFTER)["Can"]
    assert control.answer.startswith("Only within about ±1.0° (two sigmas), because the record does not determine")
    assert control.good is None


def predicted_with(run: Path, *, sigma_deg: float, left_deg: float) -> None:
    """Let a run's model predict with one sigma, and leave one residual."""
    model = ActuatorModel(reference_spec())
    write_model(run / "model.json", FittedModel(model, model.nominal(), doubt=Doubt((), np.zeros((0, 0)), sigma_deg)))
    curves = pd.read_csv(run / "curves.csv")
    curves["residual_after_deg"] = left_deg
    curves.to_csv(run / "curves.csv", index=False)


def test_the_interval_of_a_value_that_only_the_characterisation_knows_needs_that_one(run: Path) -> None:
    model = ActuatorModel(reference_spec())
    names = tuple(parameter.name for parameter in model.parameters)
    sigma = {parameter.name: parameter.sigma for parameter in model.parameters}
    # Nothing but priors, and a friction that is as uncertain as the stiffness is and rises with it.
    covariance = np.diag([(sigma[name] or 1.0) ** 2 for name in names])
    friction, stiffness = names.index("tau_c_mnm"), names.index("E_A_gpa")
    slope = 0.01
    covariance[friction, friction] = slope**2 * covariance[stiffness, stiffness] + 1e-8
    covariance[friction, stiffness] = covariance[stiffness, friction] = slope * covariance[stiffness, stiffness]
    values = {parameter.name: parameter.value for parameter in model.parameters}
    write_model(run / "model.json", FittedModel(model, values, doubt=Doubt(names, covariance, 0.08)))
    found = steps(run, after=AFTER)["Which"]
    half = sigma["E_A_gpa"]
    assert half is not None
    assert (
        Markup("<b>friction torque <i>τ</i><sub>c</sub></b>: <i>E</i><sub>A</sub> characterised to ±") in found.answer
    )
    assert f"instead of ±{half:.1f}" in found.answer


def test_two_effects_are_both_told_with_their_values_on_the_first_screen(run: Path) -> None:
    lag = discovery()["effects"][0] | {"title": "the sensor follows the wire late"}  # type: ignore[index]
    friction = {
        "id": "position_friction",
        "family": "friction",
        "title": "friction changes once per turn",
        "parameters": {
            "friction_sine": parameter(0.3, 0.01, ""),
            "amplitude": parameter(0.42, 0.01, ""),
            "phase_rad": parameter(0.8, 0.01, "rad"),
        },
        "probability": 1.0,
    }
    own = {"lag_s": lag["parameters"]["lag_s"], "friction_sine": friction["parameters"]["friction_sine"]}  # type: ignore[index]
    steps(run, after=AFTER, effects=[lag, friction], parameters={**discovery()["parameters"], **own})  # type: ignore[dict-item]
    text = words_of(run)
    (first_screen,) = re.findall(r'<ul class="tiles">.*?</ul>', text, flags=re.DOTALL)
    assert (
        "the sensor follows the wire late: lag of the sensor <i>τ</i><sub>T</sub> 4.020 s (95 %: 3.922 to 4.118)"
        in first_screen
    )
    assert "friction changes once per turn: amplitude of the wave <i>a</i> 0.420 (95 %: 0.400 to 0.440)" in first_screen
    # Names of the files stand nowhere but where a file is named.
    said = re.sub(r'href="[^"]*"|id="[^"]*"|title="[^"]*"', "", text)
    assert not re.search(r"\b(lag_s|friction_sine|phase_rad|tau_c_mnm|E_A_gpa|temp_rate_c_s|position_friction)\b", said)
    assert "0.800 rad (95 %: 0.780 to 0.820), 45.8°" in text
