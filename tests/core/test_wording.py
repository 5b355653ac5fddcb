"""An answer in one sentence."""

import math

import pytest

from torsight.core.words.wording import clock_words, named, not_explained, not_fixed, predicts_worse


def law(identifier, effect=None):
    return {"effect": effect, "law": identifier}


def test_laws_without_a_name_are_told_among_what_a_record_cannot_tell_apart():
    cannot = "Something is missing, and this record cannot tell which: "
    answer = {"verdict": "ambiguous", "effects": [], "laws": [law("friction_direction")]}
    assert named(answer | {"alternatives": [["torque_angle_deg"]]}) == (
        f"{cannot}friction over the direction or torque over the angle."
    )
    # A law that carries an effect's name is told by that.
    answer = {
        "verdict": "ambiguous",
        "effects": [{"id": "static_friction"}],
        "laws": [law("loading_b_winding_deg"), law("friction_dwell_s", "static_friction")],
    }
    both = "static friction with loading b over the winding of the spring"
    assert named(answer | {"alternatives": [["sensor_lag"]]}) == f"{cannot}{both} or sensor lag."


def test_what_all_explanations_contain_is_told_once():
    answer = {"verdict": "ambiguous", "effects": [{"id": "clamp_slip"}], "laws": [law("reading_time_s")]}
    said = named(answer | {"alternatives": [["marker_slip", "reading_time_s"]]})
    assert said.endswith("cannot tell which: clamp slip or marker slip, each with reading over time.")
    said = named(answer | {"alternatives": [["reading_time_s"]]})
    assert said.endswith("cannot tell which: clamp slip with reading over time or reading over time alone.")


def test_records_that_are_only_explained_alone_may_be_of_different_rigs():
    one = {"evidence": {"over_floor_after": 7.0}}
    assert not_explained(one) == "This record is not explained: the residual is 7.00 times the noise floor."
    together = not_explained(one | {"records": [{"file": "a.csv"}, {"file": "b.csv"}]})
    assert together.startswith("The 2 records are not explained together: the residual is 7.00 times the noise floor.")
    assert "not of one rig" in together
    assert not not_explained({"evidence": {"over_floor_after": 1.5}, "records": [{}, {}]})


@pytest.mark.parametrize("held_out", [None, math.nan])
def test_a_record_of_one_half_cycle_has_no_error_on_held_out_ones(held_out: float | None):
    part = {"rmse_train_deg": 0.06, "rmse_held_out_deg": held_out}
    assert not not_fixed({"verdict": "none", "before": part, "after": part, "noise_floor_deg": 0.06})


def test_an_extended_model_that_predicts_worse_than_the_plain_one_is_no_gain():
    def answer(before, after, **more):
        return {"before": {"rmse_held_out_deg": before}, "after": {"rmse_held_out_deg": after}, **more}

    law_of_time = {"drivers": [{"variable": "time_s", "share": 1.0}]}
    said = predicts_worse(answer(3.112, 3.7997, **law_of_time))
    assert said.startswith("The extended model predicts held-out half-cycles worse than the plain model")
    assert "(3.80° instead of 3.11° rms)" in said
    assert not predicts_worse(answer(3.112, 2.9, **law_of_time))
    assert not predicts_worse(answer(0.1011, 0.1012, **law_of_time))  # both 0.10°
    assert not predicts_worse(answer(None, None, **law_of_time))
    assert not predicts_worse(answer(3.112, 3.7997))  # the plain model is the answer


def test_an_offset_in_seconds_of_the_calendar_keeps_its_last_digits():
    sync = {"offset_s": {"value": 1715678500.4934, "ci95": [1715678500.3547, 1715678500.6821]}}
    assert clock_words(sync, unknown="-")[0] == ("offset", "1715678500.493 s (95 %: 1715678500.355 to 1715678500.682)")
