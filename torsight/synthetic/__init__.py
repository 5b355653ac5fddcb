"""A rig with its own integrator and a camera that films it: experiments with known answers.

In: a scene (``SCENE.toml``). Out: a film, a temperature log and the truth of both. :mod:`torsight.synthetic.rig`
simulates the rig, :mod:`torsight.synthetic.effects` holds its effects that the plain model lacks,
:mod:`torsight.synthetic.filming` films it; ``experiment`` simulates a scene, ``scene_files`` writes its files.
"""

from __future__ import annotations

from torsight.core.lazy import lazily

__getattr__, __dir__ = lazily(__name__, __file__)
