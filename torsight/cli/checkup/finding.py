"""A finding of the doctor, and the verdict over all findings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from torsight.core.errors import TorsightError

LEVELS: Final = ("fine", "note", "limits", "stops")
"""Severity of a finding: harmless, worth knowing, limits the result, prevents a result."""
RESIDUAL_DEG: Final = 0.3
"""Residual of the plain model on a good record, degrees: an angle that is known better than this limits nothing. On a
synthetic rig without a missing effect the residual is 0.1°; on a real rig it is always larger."""
_VERDICTS: Final = {"fine": "good", "note": "good", "limits": "usable", "stops": "do again"}


@dataclass(frozen=True, slots=True)
class Finding:
    """A finding as a sentence, with advice where there is any.

    A finding is about the film, the right film, the log, the actuator, the camera, the clock, the experiment, the
    record or the installation; its level is one of :data:`LEVELS`. ``angle_deg`` is the resulting error of the angle,
    where this is known: larger errors come first. ``error`` is the error with which ``torsight run`` would end.
    """

    about: str
    level: str
    text: str
    do: str = ""
    angle_deg: float | None = None
    error: TorsightError | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the finding for a script."""
        content = {"about": self.about, "level": self.level, "text": self.text, "do": self.do}
        return {**content, "angle_deg": self.angle_deg}


@dataclass(slots=True)
class Check:
    """Check of one film or log: findings ``about`` it, measured figures for a script, and its length (0: not known)."""

    about: str
    findings: list[Finding] = field(default_factory=list)
    content: dict[str, Any] = field(default_factory=dict)
    duration_s: float = 0.0

    def add(self, level: str, text: str, do: str = "", angle_deg: float | None = None) -> None:
        """Append a finding."""
        self.findings.append(Finding(self.about, level, text, do, angle_deg))

    def refuse(self, error: TorsightError) -> None:
        """Append an error as a finding that prevents the run."""
        self.findings.append(refusal(self.about, error))


def refusal(about: str, error: TorsightError) -> Finding:
    """Return an error as a finding that prevents the run."""
    return Finding(about, "stops", str(error), error=error)


def ordered(findings: Iterable[Finding]) -> list[Finding]:
    """Return the findings by severity: level first, then the error of the angle, then in their order."""
    return sorted(findings, key=lambda item: (-LEVELS.index(item.level), -(item.angle_deg or 0.0)))


def verdict(findings: Sequence[Finding]) -> str:
    """Return ``good``, ``usable`` or ``do again``."""
    worst = max((LEVELS.index(item.level) for item in findings), default=0)
    return _VERDICTS[LEVELS[worst]]


def exit_code(findings: Sequence[Finding]) -> int:
    """Return the exit code of a run: that of the first refusal, 4 where no result is possible, else 0."""
    stopping = [item for item in findings if item.level == "stops"]
    if not stopping:
        return 0
    codes = [item.error.exit_code for item in stopping if item.error is not None]
    return min(codes, default=4)
