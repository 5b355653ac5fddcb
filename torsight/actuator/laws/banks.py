"""Banks of kernels: the priors of the laws, usual forms and smooth functions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from torsight.actuator.laws.acts import TEMPERATURES
from torsight.actuator.laws.nodes import COLDEST
from torsight.actuator.laws.phase_window import IN_WINDOW, exponential_lead, phase_places
from torsight.core.law import Kernel, outer, slope, smooth_kernels, usual_kernels
from torsight.core.units import DEG, Floats

_COUNTS = (2.0, 5.0)
"""Numbers of counts over which a change persists or a limit is approached; records have four to twelve half-cycles."""
_LEFT = (0.01, 0.05)
"""Shares of the transformation that a logistic law places before a window, and after it: usual ones; the exponential
leaves 1 %."""
_RELAXES_S = (10.0, 100.0, 1000.0)
"""Onset times of relaxations with the logarithm of time: the decades between one row and a whole record, s."""


def waves(nodes: Floats) -> tuple[Kernel, ...]:
    """Return a constant, a slope, waves one to six times per turn, and smooth functions."""
    turn = nodes * DEG
    waves = tuple(
        Kernel(f"wave, {n} per turn", outer(np.sin(n * turn)) + outer(np.cos(n * turn)), smooth=False)
        for n in range(1, 7)
    )
    forms = usual_kernels([("constant", np.ones_like(nodes)), ("slope", nodes - nodes.mean())])
    return (*forms, *waves, *smooth_kernels(nodes))


def wound(nodes: Floats) -> tuple[Kernel, ...]:
    """Return slopes and cubics beyond an onset of either half, and smooth functions."""
    onsets = np.quantile(nodes, [0.5, 0.6, 0.7, 0.8])
    forms = [("slope", nodes - nodes[0])]
    forms += [(f"cubic beyond {onset:.0f}°", np.maximum(0.0, nodes - onset) ** 3) for onset in onsets]
    return (*usual_kernels(forms), *smooth_kernels(nodes, shares=(0.5, 0.25, 0.12)))


def plain(nodes: Floats) -> tuple[Kernel, ...]:
    """Return a slope, a bow and smooth functions, all with zero mean: the model's own values take up a mean."""
    middle = nodes - 0.5 * (nodes[0] + nodes[-1])
    forms = [("slope", middle), ("bow", middle**2 - np.mean(middle**2))]
    return (*usual_kernels(forms), *_less(smooth_kernels(nodes, line=True), np.full(len(nodes), 1.0 / len(nodes))))


def from_room(nodes: Floats) -> tuple[Kernel, ...]:
    """Return functions of one wire's temperature that vanish where the wire is coldest: proportional, square, smooth.

    A cold sensor, however it is mounted, is as warm as its wire. A constant error of one wire's temperature is
    equivalent to springs with different transformation temperatures (:func:`unlike`). The model's own values, which the
    springs share, take up a constant error of both wires (:func:`plain`), but not of one.
    """
    off = nodes - nodes[COLDEST]
    forms = [("proportional", off), ("square", off * np.abs(off))]
    return (*usual_kernels(forms), *_less(smooth_kernels(nodes, line=True), np.eye(len(nodes))[COLDEST]))


def _less(kernels: Sequence[Kernel], weights: Floats) -> tuple[Kernel, ...]:
    """Return the kernels of functions minus their sum over the nodes with weights (k,)."""
    less = np.eye(len(weights)) - weights
    return tuple(replace(one, matrix=less @ one.matrix @ less.T) for one in kernels)


def from_zero(nodes: Floats) -> tuple[Kernel, ...]:
    """Return functions that vanish at the first node: proportional, square root, and smooth."""
    off = nodes - nodes[0]
    smooth = smooth_kernels(off, shares=(0.7, 0.35, 0.2))
    return (*usual_kernels([("proportional", off), ("root", np.sqrt(off))]), *_less(smooth, np.eye(len(off))[0]))


def through_zero(nodes: Floats) -> tuple[Kernel, ...]:
    """Return functions of a signed variable: proportional, square with the variable's sign, and smooth."""
    forms = [("proportional", nodes), ("square", nodes * np.abs(nodes))]
    return (*usual_kernels(forms), *smooth_kernels(nodes))


def counted(nodes: Floats) -> tuple[Kernel, ...]:
    """Return a slope, decays towards a limit, and sums of persistent changes; all vanish at the first node.

    The change from one count to the next is an Ornstein-Uhlenbeck process: beyond the record the law continues with its
    last rate for about the correlation length of the changes, then stays constant (zero length: a random walk). A slope
    has such changes beside it, because no wear goes on at quite the same rate.
    """
    off = nodes - nodes[0]
    forms = [(f"towards a limit, {n} of them", 1.0 - np.exp(-off / n)) for n in _COUNTS if len(nodes) > n]
    common = np.minimum.outer(off, off)
    sums = {"from one to the next": common}
    for n in _COUNTS:
        faded, apart = np.exp(-off / n), np.exp(-np.abs(np.subtract.outer(off, off)) / n)
        # Covariance of the process's integral from 0 to either count.
        sums[f"changes that last for {n:g}"] = 2.0 * common + n * (np.add.outer(faded, faded) - apart - 1.0)
    changes = [Kernel(name, matrix / matrix[-1, -1], smooth=True) for name, matrix in sums.items()]
    line = outer(off)
    # Where wear is proportional to what is left, its rate has changed by a tenth once a tenth is lost.
    steady = Kernel("slope", line + 0.1**2 * line[-1, -1] * changes[-1].matrix, smooth=False)
    return (steady, *usual_kernels(forms), *changes)


def drifting(nodes: Floats) -> tuple[Kernel, ...]:
    """Return a slope, and smooth functions with a slope."""
    kernels = smooth_kernels(nodes, shares=(0.5, 0.2, 0.1), line=True)
    return (Kernel("slope", slope(nodes), smooth=False), *kernels)


def relaxing(nodes: Floats) -> tuple[Kernel, ...]:
    """Return functions that vanish at the first node: proportional to time, logarithmic in time, and smooth."""
    off = nodes - nodes[0]
    forms = [("proportional", off)]
    forms += [(f"logarithm of time from {onset:g} s", np.log1p(off / onset)) for onset in _RELAXES_S]
    smooth = smooth_kernels(nodes, shares=(0.5, 0.2, 0.1), line=True)
    return (*usual_kernels(forms), *_less(smooth, np.eye(len(off))[0]))


def wandering(nodes: Floats) -> tuple[Kernel, ...]:
    """Return functions for the offset of one clock from another: a constant, a slope, both with a small smooth part.

    This part is a tenth of the offset: computers that were never synchronised differ by seconds and drift by tenths of
    a second an hour (200 ppm), and a network's corrections move a clock by some tens of milliseconds (Mills, RFC 5905).
    """
    constant = np.ones_like(nodes)
    line = outer(constant) + slope(nodes)
    smooth = smooth_kernels(nodes, shares=(0.5, 0.25, 0.12))
    return (
        *usual_kernels([("constant", constant), ("slope", nodes - nodes.mean())]),
        *(replace(one, matrix=line + 0.1**2 * one.matrix) for one in smooth),
    )


def leading(nodes: Floats) -> tuple[Kernel, ...]:
    """Return usual phase laws in place of the cosine, and their sum with smooth functions.

    Each exists twice: with one function for heating and cooling, and with independent ones. Nodes are steps from the
    start of a window to its end (:mod:`~torsight.actuator.laws.phase_window`), heating before cooling. Beyond either
    end a smooth function fades out, because there it would describe a transformation far from its window.
    """
    own = nodes[: len(nodes) // 2]
    place = phase_places(own)
    forms = {"exponential": exponential_lead(place)}
    for share in _LEFT:
        logistic = np.tanh(math.log((1.0 - share) / share) * (0.5 - place))
        forms[f"logistic, {share:.0%} past either end"] = np.arccos(logistic) / np.pi - place
    past = np.abs(own - np.clip(own, 0.0, IN_WINDOW))
    # Over two steps, a choice: past a window they are a tenth of it.
    within = np.exp(-((past / 2.0) ** 2))
    faded = np.outer(within, within)
    usual = sum(outer(form) for form in forms.values())
    kinds = [(kernel, False) for kernel in usual_kernels(list(forms.items()))]
    kinds += [(replace(one, matrix=usual + faded * one.matrix), True) for one in smooth_kernels(own)]
    return tuple(
        Kernel(f"{kernel.name}, {way}", np.asarray(np.kron(both, kernel.matrix), np.float64), smooth=smooth)
        for way, both in (("alike", np.ones((2, 2))), ("each way its own", np.eye(2)))
        for kernel, smooth in kinds
    )


def unlike(nodes: Floats) -> tuple[Kernel, ...]:
    """Return the covariances of two springs' differences: transformation temperatures, moduli, critical angle, all.

    The values are those of :func:`differing`: four temperatures in °C, four shares in per cent.
    """
    place = np.arange(len(nodes))
    angle = place == place[-1]
    together, moduli = place < TEMPERATURES, (place >= TEMPERATURES) & ~angle
    alike, scaled, critical = (np.outer(one, one).astype(np.float64) for one in (together, moduli, angle))
    return (
        Kernel("transformation temperatures together", alike, smooth=False),
        Kernel("moduli together", scaled, smooth=False),
        Kernel("critical angle", critical, smooth=False),
        Kernel("all values", alike + scaled + 0.1 * np.eye(len(nodes)), smooth=True),
    )


def antisymmetric(nodes: Floats) -> tuple[Kernel, ...]:
    """Return the one function that differs between two directions."""
    return usual_kernels([("sign", nodes)])
