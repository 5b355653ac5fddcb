"""One thing that was found, and the verdict over all of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from torsight.core.errors import TorsightError
from torsight.core.tracks import USUAL_SHARE

LEVELS: Final = ("fine", "note", "limits", "stops")
"""How much a finding matters: not at all, worth knowing, limits the result, there will be no result."""
FEW: Final = (1.0 - USUAL_SHARE) / 5.0
"""Share of a film's frames, or of its time, that is not worth a word: a fifth of what a track may lack without a
warning."""
RESIDUAL_DEG: Final = 0.3
"""What the plain model leaves on a good record: an angle that is known better than this limits nothing. Of a synthetic
rig that lacks nothing it leaves 0.1°; no real rig is without a remainder."""
_VERDICTS: Final = {"fine": "good", "note": "good", "limits": "usable", "stops": "do again"}


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was found, as a sentence, and what to do about it, if anything.

    It is about the film, the right film, the log, the actuator, the camera, the clock, the experiment, the record or
    the installation; its level is one of :data:`LEVELS`. ``angle_deg`` is the error of the angle that it makes, where
    that is known: the larger ones come first. ``error`` is the refusal that ``torsight run`` would end with.
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
    """What was found about one film or log: findings, measured figures for a script, and its length (0: not known)."""

    findings: list[Finding] = field(default_factory=list)
    content: dict[str, Any] = field(default_factory=dict)
    duration_s: float = 0.0


def refusal(about: str, error: TorsightError) -> Finding:
    """Return an error that was met as a finding that stops the run."""
    return Finding(about, "stops", str(error), error=error)


def ordered(findings: Iterable[Finding]) -> list[Finding]:
    """Return findings by how much they matter: level first, then the error of the angle; else as found."""
    return sorted(findings, key=lambda item: (-LEVELS.index(item.level), -(item.angle_deg or 0.0)))


def verdict(findings: Sequence[Finding]) -> str:
    """Return ``good``, ``usable`` or ``do again``."""
    worst = max((LEVELS.index(item.level) for item in findings), default=0)
    return _VERDICTS[LEVELS[worst]]


def exit_code(findings: Sequence[Finding]) -> int:
    """Return the code that a run would end with: of the first refusal, 4 where nothing could come out, else 0."""
    stopping = [item for item in findings if item.level == "stops"]
    if not stopping:
        return 0
    codes = [item.error.exit_code for item in stopping if item.error is not None]
    return min(codes, default=4)
