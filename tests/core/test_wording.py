"""An answer in one sentence."""

from torsight.core.words.wording import named, not_explained


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


def test_records_that_are_only_explained_alone_may_be_of_different_rigs():
    one = {"evidence": {"over_floor_after": 7.0}}
    assert not_explained(one) == "This record is not explained: the residual is 7.00 times the noise floor."
    together = not_explained(one | {"records": [{"file": "a.csv"}, {"file": "b.csv"}]})
    assert together.startswith("The 2 records are not explained together: the residual is 7.00 times the noise floor.")
    assert "not of one rig" in together
    assert not not_explained({"evidence": {"over_floor_after": 1.5}, "records": [{}, {}]})
