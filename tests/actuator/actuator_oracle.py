"""A slow second implementation of model.md, in plain Python, by another procedure than the kernel's.

Both springs are kept by name, the unknown is ξ (not the angle), the angle for a trial ξ is found by bisection inside
it, and nothing is shared with the package but the numbers of the rig.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field


@dataclass
class Values:
    """SI values; defaults are the reference rig of model.md."""

    d_m: float = 0.5e-3
    length_m: float = 3 * math.pi * 6.8e-3
    e_a: float = 60e9
    e_m: float = 20e9
    e_s: float = 5e9
    a_s: float = 36.0
    a_f: float = 54.0
    m_s: float = 42.0
    m_f: float = 28.0
    c_a: float = 32e6
    c_m: float = 32e6
    theta_cr: float = math.pi
    theta_p: float = 6 * math.pi
    tau_c: float = 0.79e-3

    def __post_init__(self) -> None:
        # Once: the bisections ask millions of times.
        self.c2 = 32.0 / (math.pi * self.d_m**3)
        self.k_a, self.k_m, self.k_s = (
            self.d_m / (2.0 * self.length_m) / self.c2 * modulus for modulus in (self.e_a, self.e_m, self.e_s)
        )
        self.tau_cr = self.k_m * self.theta_cr

    def k_of(self, xi: float) -> float:
        return self.k_a + xi * (self.k_m - self.k_a)

    def loading(self, theta: float) -> float:
        if theta <= self.theta_cr:
            return self.k_m * theta
        return self.tau_cr + self.k_s * (theta - self.theta_cr)

    def martensite(self, theta: float, wound: float) -> float:
        if theta >= wound:
            return self.loading(theta)
        return min(self.loading(theta), self.loading(wound) - self.k_m * (wound - theta))


def bisect(function, low: float, high: float, steps: int = 46) -> float:
    """Root of a function with a change of sign between the two."""
    at_low = function(low)
    if at_low == 0.0:
        return low
    for _ in range(steps):
        middle = 0.5 * (low + high)
        if (function(middle) > 0.0) == (at_low > 0.0):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def turns(temps: list[float], threshold: float = 1.0) -> list[int]:
    """Direction of every sample: a turn is where it leaves for good an extremum from which it goes back by more."""
    pivots, sense, extreme = [0], 1, 0
    for k, value in enumerate(temps):
        if (value - temps[extreme]) * sense > 0:
            extreme = k
        elif (temps[extreme] - value) * sense >= threshold:
            fall = (value - temps[extreme]) / (k - extreme)
            above = [(temps[i] - temps[extreme] - fall * (i - extreme)) * sense for i in range(extreme, k)]
            pivots.append(extreme + above.index(max(above)) + 1)
            sense, extreme = -sense, k
    out, sense = [], 1
    for first, last in zip(pivots, [*pivots[1:], len(temps)], strict=True):
        out += [sense] * (last - first)
        sense = -sense
    return out


@dataclass
class Reference:
    theta: float
    tau: float
    xi: float
    slides: bool = False


@dataclass
class Oracle:
    """State of both springs; ``run`` takes one half-cycle after the other."""

    v: Values
    theta_a: float
    holds: bool = False
    wound: list[float] = field(default_factory=list)
    last: int | None = None
    tau: float = 0.0
    floor: float = 0.0

    def __post_init__(self) -> None:
        v = self.v
        self.wound = []
        for own in (self.theta_a, v.theta_p - self.theta_a):
            self.wound.append(self._wound(own, v.loading(v.theta_p - own) + v.tau_c))

    def _wound(self, theta: float, torque: float) -> float:
        """From where cold martensite at this angle was unwound, if it lies below its loading curve."""
        if self.v.loading(theta) <= torque:
            return theta
        return bisect(lambda wound: self.v.martensite(theta, wound) - torque, theta, theta + 30.0)

    def run(self, spring: int, temps: list[float]) -> list[float]:
        v = self.v
        theta = self.theta_a if spring == 0 else v.theta_p - self.theta_a
        if self.last is not None:
            self.wound[self.last] = self._wound(self.theta_a if self.last == 0 else v.theta_p - self.theta_a, self.tau)
        self.last = spring
        other = 1 - spring
        theta_l = max(0.0, self.wound[spring] - v.theta_cr) * (1.0 - v.e_s / v.e_m)
        theta, tau = self._let_go(theta, v.martensite(theta, self.wound[spring]), self.wound[other])
        self.wound[other] = max(self.wound[other], v.theta_p - theta)
        self.theta_a = theta if spring == 0 else v.theta_p - theta
        ref, xi, xi_0, before = Reference(theta, tau, 1.0), 1.0, 1.0, 1
        angles = []
        for temp, direction in zip(temps, turns(temps), strict=True):
            if direction != before:
                ref, xi_0, before = Reference(theta, tau, xi), xi, direction
                self.floor = self._wound(theta, tau)
                if direction > 0:
                    # What winding to this angle leaves bounds what heating recovers, for each share of martensite.
                    left = max(0.0, self.floor - v.theta_cr) * (1.0 - v.e_s / v.e_m)
                    theta_l = left if xi > 1.0 - 1e-9 else min(theta_l, left / max(xi, 1e-9))
            if self._law(temp, direction, tau, xi, xi_0) == xi:
                angles.append(self.theta_a - 0.5 * v.theta_p)
                continue
            theta, xi, tau = self._sample(temp, direction, theta, xi, xi_0, ref, theta_l, self.wound[other])
            self.wound[other] = max(self.wound[other], v.theta_p - theta)
            self.theta_a = theta if spring == 0 else v.theta_p - theta
            angles.append(self.theta_a - 0.5 * v.theta_p)
        self.tau = tau
        return angles

    def _let_go(self, theta: float, tau: float, wound: float) -> tuple[float, float]:
        """Where the springs come to rest before anything is heated: elastic on one side, martensite on the other.

        Where the disk is held instead, the torque is the nearest one with which friction holds it.
        """
        v = self.v
        if self.holds:
            other = v.martensite(v.theta_p - theta, wound)
            return theta, min(max(tau, other - v.tau_c), other + v.tau_c)
        for way in (-1.0, 1.0):

            def over(angle: float, way: float = way) -> float:
                return v.martensite(v.theta_p - angle, wound) - way * v.tau_c - tau - v.k_m * (angle - theta)

            if way * over(theta) > 1e-12:
                end = bisect(over, theta, theta + way * 8.0)
                return end, tau + v.k_m * (end - theta)
        return theta, tau

    def _law(self, temp: float, direction: int, tau: float, xi: float, xi_0: float) -> float:
        v = self.v
        if direction > 0:
            start, finish = v.a_s + v.c2 * tau / v.c_a, v.a_f + v.c2 * tau / v.c_a
            if temp <= start:
                return xi
            share = min(1.0, (temp - start) / (finish - start))
            return min(xi, xi_0 / 2.0 * (math.cos(math.pi * share) + 1.0))
        start, finish = v.m_s + v.c2 * tau / v.c_m, v.m_f + v.c2 * tau / v.c_m
        if temp >= start:
            return xi
        share = max(0.0, (temp - finish) / (start - finish))
        return max(xi, (1.0 - xi_0) / 2.0 * math.cos(math.pi * share) + (1.0 + xi_0) / 2.0)

    def _sample(self, temp, direction, theta, xi, xi_0, ref, theta_l, wound):  # noqa: C901 - the rule in one piece
        v = self.v
        way = -1.0 if direction > 0 else 1.0

        def made(angle: float, fraction: float) -> float:
            torque = ref.tau + v.k_of(fraction) * (angle - ref.theta - theta_l * (fraction - ref.xi))
            return torque if direction > 0 else max(torque, v.martensite(angle, self.floor))

        def carried(angle: float) -> float:
            return v.martensite(v.theta_p - angle, wound) - way * v.tau_c

        def stuck(fraction: float) -> float:
            return fraction - self._law(temp, direction, made(theta, fraction), xi, xi_0)

        end = 0.0 if direction > 0 else 1.0
        fraction = xi if stuck(xi) == 0.0 else bisect(stuck, end, xi)
        limit = carried(theta)
        if way * (limit - made(theta, fraction)) <= 1e-12 and not ref.slides:
            return theta, fraction, made(theta, fraction)
        if not ref.slides:
            edge = xi
            if way * (limit - made(theta, xi)) < 0.0:
                edge = bisect(lambda f: made(theta, f) - limit, fraction, xi)
            ref.theta, ref.tau, ref.xi, ref.slides = theta, limit, edge, True

        def balanced(fraction: float) -> float:
            def unbalanced(angle: float) -> float:
                return made(angle, fraction) - carried(angle)

            if way * (limit - made(theta, fraction)) <= 0.0:
                return theta
            return bisect(unbalanced, theta, theta + way * 8.0)

        def sliding(fraction: float) -> float:
            return fraction - self._law(temp, direction, carried(balanced(fraction)), xi, xi_0)

        fraction = xi if abs(sliding(xi)) < 1e-13 else bisect(sliding, end, xi)
        angle = balanced(fraction)
        return angle, fraction, carried(angle)
