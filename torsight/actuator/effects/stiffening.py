r"""The stress-induced martensite ends: a spring that is wound far stiffens.

.. math:: τ = τ_0(θ) + k_3 R^3 \left(\frac{(θ − θ_{on})_+}{R}\right)^p

θ a spring's own winding, θ_on winding at which stiffening begins (°), k_3 in mN·m/rad³ with R = 100°, p exponent (3:
the usual cubic; 1: a third slope); the torque is added to that of either spring's phase. Its slope is limited to
austenite's stiffness, which no spring exceeds. A share w of it belongs to the loading curve (p = 1: a third slope of
this curve), so that the spring unwinds along K_M; of that part the recoverable angle, which remains after unwinding,
follows a share f (0: it is as without stiffening). Predicted residual: stroke is lost at both ends, equally in both
directions. Source: the paper, section 4.1, step 2; end of detwinning, e.g. Lagoudas, Shape Memory Alloys (2008), ch. 1.
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values, share
from torsight.actuator.ports import REACH_RAD, no_steeper
from torsight.core.units import DEG, MNM, Floats


def apply(ports: Ports, values: Values) -> Ports:
    """Let both springs stiffen: k_3 R³ ((θ − θ_on)₊ / R)^p at rising angles, with a limited slope."""
    loading, theta_rad = values["stiffening_loading_share"], ports.grid_rad()
    past = np.maximum(0.0, theta_rad - values["stiffening_onset_deg"] * DEG) / REACH_RAD

    def part_nm(of_it: float, steepest_nm: float) -> Floats:
        cubic_nm = of_it * values["stiffening_mnm_per_rad3"] * MNM
        return no_steeper(cubic_nm * REACH_RAD**3 * past ** values["stiffening_exponent"], theta_rad, steepest_nm)

    if loading > 0.0:
        follows = values["stiffening_followed_share"]
        ports = ports.with_loading(part_nm(loading, ports.steepest_bend_nm), follows=follows)
    return ports if loading == 1.0 else ports.with_side(part_nm(1.0 - loading, ports.rig.k_austenite))


EFFECT = Effect(
    id="stiffening",
    family="material",
    acts_on="torque",
    title="a spring that is wound far stiffens",
    parameters=(
        Parameter("stiffening_mnm_per_rad3", 0.03, "mN·m/rad³", 0.0, 50.0, null=0.0, symbol="k_3", title="stiffening"),
        Parameter(
            name="stiffening_onset_deg",
            value=600.0,
            unit="°",
            lower=100.0,
            upper=2000.0,
            sigma=200.0,
            symbol="θ_on",
            title="winding at which stiffening begins",
        ),
        Parameter("stiffening_exponent", 3.0, "", 0.8, 6.0, sigma=1.0, symbol="p", title="power of the stiffening"),
        share("stiffening_loading_share", 0.0, symbol="w", title="share that belongs to the loading curve"),
        share(
            "stiffening_followed_share", 1.0, symbol="f", title="share of that part which the recoverable angle follows"
        ),
    ),
    apply=apply,
    starts=(
        {"stiffening_mnm_per_rad3": 0.3, "stiffening_onset_deg": 680.0},
        {"stiffening_mnm_per_rad3": 0.01, "stiffening_onset_deg": 500.0},
        {"stiffening_mnm_per_rad3": 0.03, "stiffening_onset_deg": 640.0, "stiffening_exponent": 1.0},
        {"stiffening_mnm_per_rad3": 0.03, "stiffening_onset_deg": 600.0, "stiffening_loading_share": 0.9},
        {
            "stiffening_mnm_per_rad3": 0.04,
            "stiffening_onset_deg": 660.0,
            "stiffening_exponent": 1.0,
            "stiffening_loading_share": 0.9,
        },
        {
            "stiffening_mnm_per_rad3": 0.03,
            "stiffening_onset_deg": 560.0,
            "stiffening_loading_share": 0.9,
            "stiffening_followed_share": 0.1,
        },
    ),
    laws=("winding_winding_deg", "loading_winding_deg", "loading_alone_winding_deg"),
)
