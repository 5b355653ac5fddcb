"""Film and temperature log on one clock: logs as they come, offset and drift with intervals, the merged table."""

from sync.clock import estimate_clock
from sync.merge import merge
from sync.reading import read_temperature_log
from sync.repairs import LogReading, Repair, Restart

__all__ = ["LogReading", "Repair", "Restart", "estimate_clock", "merge", "read_temperature_log"]
