"""The run in Rerun: the recording of a finished run, and the live view; nothing else here imports rerun.

Timelines: ``film_time`` (seconds on the film's clock) and ``frame`` (number of the film's frame).

========================================================= ==========================================================
entity                                                    what
========================================================= ==========================================================
``film/picture``                                          the film (a small AV1 preview) or the live picture
``film/markers``                                          the four markers that were found, with their names
``film/sticks``                                           the two sticks and the angle between them, written beside
``angle/measured``, ``angle/plain``, ``angle/extended``   the angle as measured and as modelled, degrees
``angle/half_cycle``                                      points where a half-cycle begins
``residual/before``, ``residual/after``                   measured less plain, measured less extended model, degrees
``residual/above``, ``residual/below``                    two sigmas of the measured angle, degrees
``temperature/a``, ``temperature/b``                      temperatures of the springs, °C
``laws/…/reached``, ``laws/…/not_reached``                a measured law over its driver, where there is one
``events``                                                occlusions, markers found again, clocks, fit, verdict
``summary``                                               the answer in words
========================================================= ==========================================================

Positions on ``film`` are in pixels of the picture that is shown, which is narrower than the film where that is wide.
"""

from __future__ import annotations

from torsight.core.lazy import lazily

__getattr__, __dir__ = lazily(__name__, __file__)
