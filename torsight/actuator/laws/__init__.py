"""The laws that the actuator's model may lack: ports of the model and the variables on which a law may depend.

A family is a port with a driver. The record determines the values that the driver takes, and with them a law's nodes
(:func:`laws_of`); the port alone determines the law's action on the model (:func:`apply_law`), so that a model file
needs no record. Ports are those of :class:`torsight.actuator.ports.Ports`; angles are in degrees, torques in mN·m,
friction in shares of τ_c.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from torsight.actuator.drive import Drive
from torsight.actuator.laws import nodes
from torsight.actuator.laws.families import FAMILIES, Family
from torsight.actuator.ports import Ports
from torsight.core.errors import ConfigError
from torsight.core.files.config import get_number, get_text
from torsight.core.law import Law, LawForm, smooth_between
from torsight.core.units import Floats

_CURVED: Final = frozenset(
    family.id
    for family in FAMILIES.values()
    if family.nodes in (nodes.angle_nodes, nodes.winding_nodes, nodes.phase_nodes)
)
"""Laws that may bend so sharply between nodes that linear interpolation would cut corners: a spline replaces it."""


def apply_law(ports: Ports, form: LawForm, values: Mapping[str, float]) -> Ports:
    """Return the ports after a law has acted on them; ``values`` are a model's, among them those of its parameters."""
    curve = between_nodes(form.id, form.nodes, form.values(values))
    return FAMILIES[form.id].apply(ports, lambda driver: np.interp(driver, *curve))


def between_nodes(law: str, nodes: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return driver values and law values that represent a law, given on its nodes (k,), by linear interpolation."""
    return smooth_between(nodes, values) if law in _CURVED else (nodes, values)


def laws_from(entries: object, *, where: str) -> tuple[LawForm, ...]:
    """Read the laws of a ``model.json``."""
    if not isinstance(entries, list) or not all(isinstance(entry, Mapping) for entry in entries):
        raise ConfigError("is no list of laws", where=where, value=repr(entries)[:80])
    return tuple(_law_from(entry, where=where) for entry in entries)


def _law_from(entry: Mapping[str, Any], *, where: str) -> LawForm:
    name = get_text(entry, "id", where=where, choices=tuple(FAMILIES))
    try:
        nodes = np.array(entry.get("nodes"), np.float64).reshape(-1)
        basis = np.array(entry.get("basis"), np.float64).reshape(len(nodes), -1)
    except (TypeError, ValueError) as error:
        raise ConfigError("a law's nodes and basis are no tables of numbers", where=where, value=name) from error
    rising = len(nodes) > 0 and bool(np.all(np.diff(nodes) > 0.0))
    if not (rising and basis.shape[1] and np.isfinite(nodes).all() and np.isfinite(basis).all()):
        raise ConfigError("a law has no rising nodes with finite values", where=where, value=name)
    unit = get_text(entry, "unit", where=where, empty=True)
    scale = get_number(entry, "scale", where=where, lower=0.0, upper=1e6)
    return LawForm(name, nodes, basis, unit, scale, prior=True)


def laws_of(drive: Drive, tau_c_mnm: float) -> tuple[Law, ...]:
    """Return the laws whose drivers a record covers, with nodes over the covered range.

    ``tau_c_mnm`` is the friction torque's start value, which scales all torques.
    """
    found, shared = [], ("id", "port", "driver", "unit", "title", "spring", "time_like")
    for family in FAMILIES.values():
        nodes = family.nodes(drive)
        if nodes is None:
            continue
        scale = family.scale * tau_c_mnm if family.unit == "mN·m" else family.scale
        found.append(
            Law(
                **{name: getattr(family, name) for name in shared},
                nodes=nodes.values,
                covered=(nodes.low, nodes.high),
                scale=scale,
                kernels=family.kernels(nodes.values),
            )
        )
    return tuple(found)


__all__ = ["FAMILIES", "Family", "apply_law", "between_nodes", "laws_from", "laws_of"]
