"""``report.html``: one self-contained page with the results of a run.

In: the tables and JSON results of a run's folder. Out: the page, and its figures beside it.
:mod:`torsight.report.figures` makes the figures, :mod:`torsight.report.plots` draws them,
:mod:`torsight.report.sections` holds the text and the tables; ``write`` assembles the page.
"""

from torsight.report.write import write_report

__all__ = ["write_report"]
