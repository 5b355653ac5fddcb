"""``report.html``: one self-contained page that shows what a run found."""

from torsight.report.write import write_report

__all__ = ["write_report"]
