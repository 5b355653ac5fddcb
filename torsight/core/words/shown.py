"""Presentation of result objects: one line of text, a small table in a notebook, a data frame, a plot.

A result defines its facts, columns and drawing; all presentations follow from these. Columns and axes are in the units
of files and reports: degrees, °C, mN·m.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from torsight.core.errors import ConfigError
from torsight.core.frozen import refuse_plainly
from torsight.core.words.wording import number

if TYPE_CHECKING:
    import pandas as pd

_FOR_FILES: Final = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")
"""Backends of matplotlib without a window."""


class Shown:
    """Base of results: ``repr``, ``summary``, ``_repr_html_``, ``to_frame`` and ``plot``."""

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        refuse_plainly(cls)

    def facts(self) -> dict[str, str]:
        """Return the main facts of the result: name and value, in words, most important first."""
        raise NotImplementedError

    def _columns(self) -> Mapping[str, Any]:
        """Return the rows of :meth:`to_frame`, column by column."""
        raise NotImplementedError

    def _draw(self, axes: Any) -> None:
        """Draw the result into matplotlib axes."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}: {value}' for name, value in self.facts().items())})"

    def summary(self) -> str:
        """Return the facts, one on each line."""
        facts = self.facts()
        width = max(map(len, facts), default=0)
        return "\n".join([type(self).__name__, *(f"  {name:<{width}}  {value}" for name, value in facts.items())])

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in self.facts().items()
        )
        return f"<table><caption>{type(self).__name__}</caption><tbody>{rows}</tbody></table>"

    def to_frame(self) -> pd.DataFrame:
        """Return a data frame: one row per instant, with ``time_s``, if the result is a series, else one per value."""
        import pandas as pd

        return pd.DataFrame(dict(self._columns()))

    def plot(self, axes: Any = None) -> Any:
        """Draw the result.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Axes to draw into; a new figure's axes if not given.

        Returns
        -------
        matplotlib.axes.Axes
            The axes that were drawn into.

        Raises
        ------
        ConfigError
            When no axes are given and matplotlib's configured backend is not installed.
        """
        if axes is None:
            axes = _own_axes()
            _warn_of_a_notebook_that_shows_nothing()
        self._draw(axes)
        return axes


def _own_axes() -> Any:
    """Return the axes of a new figure of matplotlib's configured backend."""
    try:
        from matplotlib import pyplot as plt

        return plt.subplots(layout="constrained")[1]
    except ImportError as error:
        raise ConfigError(
            f"matplotlib's backend cannot be loaded: {error}",
            where="MPLBACKEND, or the notebook",
            do="install it (in a notebook: matplotlib-inline), set MPLBACKEND=agg, or give plot() the axes of a figure",
        ) from error


def _warn_of_a_notebook_that_shows_nothing() -> None:
    """Warn where a notebook's cell will show no picture, because matplotlib's backend draws to files only."""
    import matplotlib as mpl

    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if getattr(shell, "kernel", None) is not None and str(mpl.get_backend()).lower() in _FOR_FILES:
        warnings.warn(
            f"matplotlib's backend is '{mpl.get_backend()}', which shows nothing in a notebook: run "
            "'%matplotlib inline' in a cell, or take MPLBACKEND out of the environment",
            stacklevel=3,  # whoever called plot()
        )


def span(values: Any, unit: str) -> str:
    """Return the range of the finite values in words: ``23.1 to 78.4 °C``."""
    known = np.asarray(values, np.float64)
    known = known[np.isfinite(known)]
    if not len(known):
        return "not known"
    return f"{number(float(known.min()))} to {number(float(known.max()))}{' ' if unit and unit != '°' else ''}{unit}"


def share(flags: Any) -> str:
    """Return the share of true flags in words: ``99.2 %``; 0 % for an empty series."""
    values = np.asarray(flags, np.bool_)
    return f"{100.0 * float(values.mean()) if values.size else 0.0:.1f} %"


def draw_series(axes: Any, time_s: Any, lines: Mapping[str, Any], *, label: str) -> None:
    """Draw series against time, with a legend if there is more than one."""
    for name, values in lines.items():
        axes.plot(time_s, values, label=name, linewidth=1.0)
    axes.set_xlabel("time, s")
    axes.set_ylabel(label)
    if len(lines) > 1:
        axes.legend()


def draw_models(axes: Any, columns: Mapping[str, Any]) -> None:
    """Draw the measured angle against time, and the models' angles, if any, from the columns of ``curves.csv``."""
    names = {"angle_deg": "measured", "plain_deg": "plain model", "extended_deg": "extended model"}
    lines = {words: columns[name] for name, words in names.items() if name in columns}
    draw_series(axes, columns["time_s"], lines, label="angle, °")
