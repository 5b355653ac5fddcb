"""Reading of a temperature log's file into one strictly increasing record.

In: delimited text or Parquet with the instrument's own header, columns, units and timestamps. Out: a
:class:`~torsight.core.records.TemperatureLog` (s, °C; NaN where no reading can be trusted) with a list of all repairs
and of all restarts of the logging clock. ``read_log`` runs the steps: ``header`` and ``column_names`` find the columns,
``wall_clock`` converts timestamps to seconds, ``timestamps`` and ``restart_gaps`` order them, ``outliers`` removes
readings that no spring can have.
"""
