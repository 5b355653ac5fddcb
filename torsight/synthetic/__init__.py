"""A rig with its own integrator and a camera that films it: experiments with known answers.

In: a scene (``SCENE.toml``). Out: a film, a temperature log and the truth of both. :mod:`torsight.synthetic.rig` moves
the rig, :mod:`torsight.synthetic.effects` says what the plain model lacks of it, :mod:`torsight.synthetic.filming`
films it; ``experiment`` plays a scene, ``render`` writes it.
"""

from __future__ import annotations

from typing import Final

from torsight.core.lazy import lazily

_HOMES: Final = {
    "Scene": "scene",
    "demo_scene": "scene",
    "read_scene": "scene",
    "scene_from": "scene",
    "Record": "experiment",
    "make_record": "experiment",
    "render_scene": "scene_files",
}

__getattr__, __dir__ = lazily(__name__, _HOMES)
