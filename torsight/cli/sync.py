"""``torsight sync``: film and temperature log on one clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from typer import Option

from torsight.cli.answer import Answer
from torsight.cli.console import progress_bar, say
from torsight.cli.experiment_file import KEYS
from torsight.cli.options import Columns, Fps, Units, said
from torsight.core.errors import ConfigError, InputError, NoResultError
from torsight.core.files.config import get_number, is_number
from torsight.core.files.paths import require_apart
from torsight.core.files.storage import check_keys, read_json, write_json, write_table
from torsight.core.files.tables import read_angles, write_merged
from torsight.core.progress import Progress, silent
from torsight.core.records import SyncedTable

if TYPE_CHECKING:
    from sync import LightEvents


@dataclass(frozen=True, slots=True)
class Settings:
    """Table ``[sync]``, checked; None for keys that are absent.

    Known offset and drift of the log's clock, the longest gap in the log that is bridged, the film times of an LED's
    changes, and the position of an LED in the picture, px.
    """

    offset_s: float | None
    drift_ppm: float | None
    max_gap_s: float | None
    events: LightEvents | None
    led: tuple[float, float] | None


def sync(
    *,
    angle: Annotated[Path, Option(metavar="ANGLE.csv", help="Angles on the film's clock.")],
    temperature: Annotated[Path, Option(metavar="TEMPS.csv", help="Temperature log on its own clock.")],
    out: Annotated[Path, Option(help="Folder for merged.csv and sync.json.")],
    offset: Annotated[
        float | None, Option(metavar="S", help="Known offset: temperature time minus film time as the film begins.")
    ] = None,
    drift_ppm: Annotated[float | None, Option(metavar="PPM", help="Known drift of the log's clock.")] = None,
    max_gap: Annotated[float | None, Option(metavar="S", help="Longest gap in the log that is bridged.")] = None,
    led_events: Annotated[
        Path | None, Option(metavar="EVENTS.csv", help="Film times at which an LED showed the heating switch.")
    ] = None,
    led: Annotated[
        tuple[float, float] | None, Option(metavar="X Y", help="Position of such an LED in the film, px.")
    ] = None,
    film: Annotated[str | None, Option(metavar="FILM", help="The film of the angles, for --led.")] = None,
    timestamps: Annotated[Path | None, Option(metavar="T.csv", help="The film's frame times.")] = None,
    fps: Fps = None,
    table: Annotated[
        Path | None, Option(metavar="FILE.csv", help="Write the merged table here, too (.csv or .parquet).")
    ] = None,
    columns: Columns = None,
    units: Units = None,
) -> Answer:
    """Put angles and temperatures on one clock.

    Offset and drift of the log's clock are given with an interval.

    Example: torsight sync --angle angle.csv --temperature temps.csv --out out
    """
    given = {"offset_s": offset, "drift_ppm": drift_ppm, "max_gap_s": max_gap, "led_events": led_events, "led": led}
    settings = {key: value for key, value in given.items() if value is not None}
    try:
        with progress_bar() as progress:
            sync_to_folder(
                angle,
                temperature,
                settings=settings,
                out=out,
                film=film,
                timestamps=timestamps,
                fps=fps,
                table=table,
                **said(columns, units),
                progress=progress,
            )
    except (InputError, NoResultError) as error:
        if (out / "merged.csv").exists():
            error.do = "; ".join(filter(None, (error.do, f"{out / 'merged.csv'} is that of an earlier sync")))
        raise
    content = read_json(out / "sync.json")
    say(*summary_lines(content))
    files = (out / "merged.csv", out / "sync.json", *(() if table is None else (table,)))
    return Answer(content, files=files)


def sync_to_folder(
    angle: Path,
    temperature: Path,
    *,
    settings: Mapping[str, Any],
    out: Path,
    film: str | Path | None = None,
    timestamps: Path | None = None,
    fps: float | None = None,
    table: Path | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    progress: Progress = silent,
) -> SyncedTable:
    """Read both files, find the clock, write ``merged.csv``, ``sync.json`` (for an LED ``led_events.csv``).

    ``settings`` is the table ``[sync]`` of the experiment; ``film``, ``timestamps`` and ``fps`` describe the film of
    the angles and are needed only for ``led``. ``table`` is a second file for the merged table.

    Raises ConfigError for an unknown key or a value out of range; InputError when a file cannot be used, or film and
    log do not overlap; NoResultError when the offset is not given and cannot be found.
    """
    from sync import film_light_events, find_clock, merge, read_temperature_log
    from sync.log.timestamps import longest_gap_s
    from sync.merge.merged_table import require_overlap, sync_content
    from sync.merge.slow_motion import slow_motion_text
    from torsight.core.files.lock import only_writer
    from tracker.frames.timing import timing

    steps = 4.0
    known = read_settings(settings)
    events = Path(settings["led_events"]) if "led_events" in settings else None
    written = [out / "merged.csv", out / "sync.json", *([] if known.led is None else [out / "led_events.csv"])]
    written += [] if table is None else [table]
    require_apart(written, [angle, temperature, events, timestamps])
    progress("one clock", 0.0, steps)
    angles = read_angles(angle)
    reading = read_temperature_log(temperature, columns=columns, units=units)
    progress("one clock", 1.0, steps)
    with only_writer(out):
        light = known.events
        if known.led is not None:
            if film is None:
                raise ConfigError("an LED needs its film", where="--led", do="name the film with --film")
            light = film_light_events(film, known.led, fps=fps, timestamps=timestamps, progress=progress)
            write_table(out / "led_events.csv", {"time_s": light.time_s, "on": light.goes_on})
        slow = slow_motion_text(
            float(np.ptp(angles.time_s)), float(np.ptp(reading.log.time_s)), rate_fps=timing(angles.time_s).rate_fps
        )
        if slow is not None:
            say(f"warning: {angle}: {slow[0]}; {slow[1]}")
        try:
            found = find_clock(
                angles, reading, given_offset_s=known.offset_s, given_drift_ppm=known.drift_ppm, light=light
            )
        except (InputError, NoResultError) as error:
            error.where = f"{angle} and {temperature}, {error.where}"
            raise
        clock, reading = found.clock, found.reading
        progress("one clock", 2.0, steps)
        max_gap_s = longest_gap_s(reading.log.time_s) if known.max_gap_s is None else known.max_gap_s
        merged = merge(angles, reading.log, clock, max_gap_s=max_gap_s)
        require_overlap(merged, angles, reading.log, clock, where=str(temperature))
        progress("one clock", 3.0, steps)
        for path in [out / "merged.csv", *([] if table is None else [table])]:
            write_merged(path, merged)
        write_json(out / "sync.json", sync_content(clock, reading, merged, max_gap_s=max_gap_s))
    progress("one clock", steps, steps)
    return merged


def read_settings(table: Mapping[str, Any]) -> Settings:
    """Return the table ``[sync]``, checked.

    Raises ConfigError for an unknown key, a value out of range, or an LED that is given in two ways; InputError when
    the file that ``led_events`` names cannot be used.
    """
    from sync import read_light_events

    where = "[sync]"
    check_keys(table, KEYS["sync"], where=where)
    limits = {"offset_s": (-1e10, 1e10), "drift_ppm": (-1e4, 1e4), "max_gap_s": (0.0, 1e6)}
    numbers = {
        key: get_number(table, key, where=where, lower=low, upper=high) if key in table else None
        for key, (low, high) in limits.items()
    }
    led = _place(table["led"]) if "led" in table else None
    if led is not None and "led_events" in table:
        raise ConfigError("both name an LED", where=where, value="led, led_events", limit="one of them")
    events = read_light_events(Path(table["led_events"])) if "led_events" in table else None
    return Settings(**numbers, events=events, led=led)


def _place(value: Any) -> tuple[float, float]:
    if not (isinstance(value, Sequence) and len(value) == 2 and all(is_number(item) for item in value)):
        raise ConfigError("'led' is no place in the picture", where="[sync]", value=repr(value), limit="[x, y], px")
    return float(value[0]), float(value[1])


def summary_lines(content: Mapping[str, Any]) -> list[str]:
    """Return the summary of ``sync.json`` for the terminal, line by line."""
    offset, drift = content["offset_s"], content["drift_ppm"]
    # A rounded zero has no sign.
    offset_text = f"offset {offset['value']:z.3f} s (95 %: {offset['ci95'][0]:z.3f} to {offset['ci95'][1]:z.3f})"
    drift_text = f"drift {drift['value']:z.0f} ppm (95 %: {drift['ci95'][0]:z.0f} to {drift['ci95'][1]:z.0f})"
    lines = [f"{offset_text}, {drift_text}", f"from {content['method']}"]
    low, high = offset["ci95_at_first_frame"]
    if f"{high - low:.3f}" != f"{offset['ci95'][1] - offset['ci95'][0]:.3f}":
        lines.append(f"at the film's first frame, far from film time 0, the offset is {low:.3f} to {high:.3f} s (95 %)")
    lines += [f"note: {note}" for note in content["notes"]]
    lines += [f"log: {repair['text']}" for repair in content["log"]["repairs"]]
    empty = content["rows_without_temperature"]
    if empty:
        limit = f"outside the log or in a gap of more than {content['max_gap_s']:g} s"
        lines.append(f"{empty} of {content['rows']} rows have no temperature ({limit})")
    return lines
