"""``report.html``: one self-contained page that shows what a run found.

In: the tables and JSON results of a run's folder. Out: the page, and its figures beside it.
:mod:`torsight.report.figures` makes the figures, :mod:`torsight.report.plots` draws them,
:mod:`torsight.report.sections` words the rest; ``write`` puts them together.
"""

from torsight.report.write import write_report

__all__ = ["write_report"]
