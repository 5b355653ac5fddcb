"""Offset and drift between the film's clock and the log's.

In: strokes, heating segments and changepoints (:mod:`sync.signals`), changes of an LED (:mod:`sync.led`), a log with
its restarts (:mod:`sync.log`). Out: temperature time = film time · (1 + drift) + offset, offset in s and drift in ppm
with 95 % intervals, and the log with its restarts shifted by the gaps that the motion or the LED determines.
``estimation`` selects the evidence; ``offset_search`` finds the possible ranges of the offset, ``threshold_likelihood``
refines them, ``motion_likelihood`` combines thresholds, stops and the sensor's lag, ``restarts`` adds the log's gaps;
every likelihood is a ``gaussian_mixture`` over offset, drift and gaps.
"""
