"""A temperature log's file to one strictly increasing record.

In: delimited text or Parquet with the instrument's own header, columns, units and timestamps. Out: a
:class:`~torsight.core.records.TemperatureLog` (s, °C; NaN where no reading can be trusted) with an account of every
repair and of every restart of the logging clock. ``read_log`` goes through it: ``header`` and ``column_names`` find the
columns, ``wall_clock`` turns timestamps into seconds, ``timestamps`` and ``restart_gaps`` order them, ``outliers``
removes readings that no spring can have.
"""
