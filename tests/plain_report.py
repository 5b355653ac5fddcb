"""Reports without their plots, for tests of what stands beside them; that plots are drawn is tested with the report."""

from __future__ import annotations

import pytest


def draw_no_plots(patch: pytest.MonkeyPatch) -> None:
    """Let a report go without drawing its plots, which takes most of its time."""
    patch.setattr("torsight.report.write.drawing", lambda _: "")
    patch.setattr("torsight.report.write.still", lambda _: "<svg></svg>")
