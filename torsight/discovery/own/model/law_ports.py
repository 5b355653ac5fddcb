"""Laws that a model of one's own may lack: the declared ones, and those that are added to an output.

A declared law enters where ``predict`` calls it. Beside the declared ones, each output may lack a law over each driver,
so that a missing effect without a name shows the variable on which it depends.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from torsight.core.law import LENGTHS, Kernel, Law, slope, smooth_kernels
from torsight.core.units import Floats
from torsight.discovery.linear_problem import law_over
from torsight.discovery.own.model.declare import LawPort
from torsight.discovery.own.model.layout import Layout

_LENGTHS: Final = (*LENGTHS, 0.03, 0.015)
"""Lengths of a law's smooth functions as shares of its range: a law with many nodes may bend over shorter lengths."""


def nodes_of(port: LawPort, low: float = 0.0, high: float = 1.0) -> Floats:
    """Return the nodes of a law over its declared range, or from ``low`` to ``high`` where no end is declared."""
    return np.linspace(low if port.low is None else port.low, high if port.high is None else port.high, port.nodes)


def port_law(port: LawPort, nodes: Floats, scale: float) -> Law:
    """Return a declared law as the engine measures it: a slope, or smooth functions of several lengths."""
    smooth = smooth_kernels(nodes, shares=_LENGTHS, line=True) if len(nodes) > 2 else ()
    kernels = (Kernel("slope", slope(nodes), smooth=False), *smooth)
    title = f"{port.name} over {port.driver}"
    return Law(port.name, port.name, port.driver, port.unit, title, nodes, scale, kernels)


def added_laws(layout: Layout, drivers: Mapping[str, Floats], observed: Floats) -> dict[str, tuple[Law, int]]:
    """Return the laws over drivers (n,) that each output may lack, by id, each with the number of its output.

    ``observed`` (n,) is NaN where unknown.
    """
    found = {}
    for k, output in enumerate(layout.outputs):
        rows = np.concatenate([np.arange(place.start, place.stop) for _, own, place in layout.places if own == k])
        rows = rows[np.isfinite(observed[rows])]
        size = float(np.std(observed[rows])) * layout.scale[k] or 1.0
        for name, values in drivers.items():
            law = law_over(name, values[rows], size)
            if law is not None:
                own_id = f"{output}({name})"
                found[own_id] = (replace(law, id=own_id, port=output, title=f"{output} over {name}"), k)
    return found
