"""Offset and drift between the film's clock and the log's.

In: strokes, heating segments and changepoints (:mod:`sync.signals`), changes of an LED (:mod:`sync.led`), a log with
its restarts (:mod:`sync.log`). Out: temperature time = film time · (1 + drift) + offset, offset in s and drift in ppm
with 95 % intervals, and the log with its restarts moved to where the motion or the LED puts them. ``estimation``
chooses the evidence; ``offset_search`` finds where on the log the film can lie at all, ``threshold_likelihood`` refines
that, ``motion_likelihood`` weighs thresholds, stops and the sensor's lag together, ``restarts`` adds the log's gaps;
every likelihood is a ``gaussian_mixture`` over offset, drift and gaps.
"""
