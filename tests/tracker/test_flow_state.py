"""A flow that goes on from a noted state looks for the same picture as one that was not interrupted."""

import json

import numpy as np

from tracker.dot import DotShape
from tracker.flow import TileFlow
from tracker.linear import STILL
from tracker.template import DotTemplate


def _template() -> DotTemplate:
    return DotTemplate(DotShape(radius_px=6.0, edge_px=1.2, stretch=(0.0, 0.0), contrast=-0.7, window_px=10.0))


def test_a_tile_rendered_before_its_dot_changed_comes_back_as_it_was() -> None:
    template = _template()
    flow = TileFlow([template], [180.0])
    assert template.reshape((0.8, 0.05, 0.0))
    state, look = json.loads(json.dumps(flow.to_state())), template.to_state()

    other = _template()
    other.restore(look)
    again = TileFlow([other], [180.0])
    again.restore(state)

    y, x = np.mgrid[0:80, 0:80]
    picture = np.clip(180.0 - 126.0 * (np.hypot(x - 41.3, y - 38.6) < 6.5), 0, 255).astype(np.uint8)
    assert again.find(picture, [(40.0, 40.0)]) == flow.find(picture, [(40.0, 40.0)])
    assert other.to_state() == look
    # It matters: a tile of the dot as it is now leads elsewhere.
    again.restore([(180.0, list(STILL), look)])
    assert again.find(picture, [(40.0, 40.0)]) != flow.find(picture, [(40.0, 40.0)])
