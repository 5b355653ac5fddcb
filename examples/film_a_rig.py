"""Make a rig of one's own, look at its record, and film a minute of it.

Run: python examples/film_a_rig.py OUT_FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from torsight.core.units import DEG
from torsight.synthetic.experiment import make_record
from torsight.synthetic.scene import scene_from
from torsight.synthetic.scene_files import render_scene

SCENE = {
    "seed": 5,
    "protocol": {"time_factor": 0.1, "half_cycle": [{"spring": "a", "peak_c": 82.0}, {"spring": "b", "peak_c": 70.0}]},
    "effects": {"sensor_lag": {"lag_s": 0.6}},
    "film": {"fps": 15.0, "seconds": 60.0},
    "camera": {"focal_px": 1500.0, "tilt_deg": 10.0},
}


def main(out: Path) -> None:
    """Print the rig's motion and friction torque, then film the rig."""
    record = make_record(SCENE, rate_hz=15.0)
    angle_deg = record.angle_rad / DEG
    print(f"{len(record.table)} rows over {record.table.time_s[-1]:.0f} s, range {np.ptp(angle_deg):.1f}°")
    print("the rig's own friction torque: {tau_c_mnm:.3f} mN·m".format(**record.played.scene.values.public))
    experiment = render_scene(scene_from(SCENE), out=out)
    print(f"filmed; analyse it with: torsight run {experiment}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "film_of_a_rig"))
