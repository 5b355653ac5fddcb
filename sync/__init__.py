"""Film and temperature log on one clock.

In: stick angles on the film's clock (rad, s), a temperature log as an instrument wrote it (its own columns, units and
clock), and, where there is one, an LED on the film that shows the heating switch. Out: the log with every row on one
increasing clock (s, °C), offset (s) and drift (ppm) between both clocks with 95 % intervals, and the merged table.

Subpackages, in the order in which the data pass through them:

- :mod:`sync.log`: a log's file to one strictly increasing record;
- :mod:`sync.signals`: strokes of the film, heating segments and changepoints of the log;
- :mod:`sync.led`: changes of an LED on the film;
- :mod:`sync.clock`: offset and drift from all of these;
- :mod:`sync.merge`: temperatures at the film's instants, and ``sync.json``.
"""

from sync.clock.estimation import Found, estimate_clock, find_clock
from sync.led import LightEvents, film_light_events, read_light_events
from sync.log.read_log import read_temperature_log
from sync.log.repairs import LogReading, Repair, Restart
from sync.merge.merged_table import merge

__all__ = [
    "Found",
    "LightEvents",
    "LogReading",
    "Repair",
    "Restart",
    "estimate_clock",
    "film_light_events",
    "find_clock",
    "merge",
    "read_light_events",
    "read_temperature_log",
]
