"""An answer in one sentence."""

from torsight.core.words.wording import named


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
