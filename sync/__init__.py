"""Film and temperature log on one clock: logs as they come, offset and drift with intervals, the merged table."""

from sync.clock import Found, estimate_clock, find_clock
from sync.lamp import film_light_events
from sync.light import LightEvents, read_light_events
from sync.merge import merge
from sync.reading import read_temperature_log
from sync.repairs import LogReading, Repair, Restart

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
