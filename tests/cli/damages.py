"""Further ways in which a file of the world of ``bad_inputs`` is damaged."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.cli.bad_inputs import Damage


def doubled(name: str, index: int) -> Damage:
    """Give a table one of its columns a second time."""

    def apply(folder: Path) -> None:
        rows = [line.split(",") for line in (folder / name).read_text().splitlines()]
        (folder / name).write_text("".join(",".join([*row, row[index]]) + "\n" for row in rows))

    return apply


def scaled(name: str, index: int, factor: float, plus: float = 0.0) -> Damage:
    """Give a column of a table in another unit."""

    def apply(folder: Path) -> None:
        header, *lines = (folder / name).read_text().splitlines()
        rows = [line.split(",") for line in lines]
        for row in rows:
            row[index] = f"{float(row[index]) * factor + plus:.15g}"
        (folder / name).write_text("\n".join([header, *(",".join(row) for row in rows)]) + "\n")

    return apply


def turned(name: str) -> Damage:
    """Turn a table's rows round."""

    def apply(folder: Path) -> None:
        header, *lines = (folder / name).read_text().splitlines()
        (folder / name).write_text("\n".join([header, *lines[::-1]]) + "\n")

    return apply


def is_a_folder(name: str) -> Damage:
    """Put a folder where a file should be."""

    def apply(folder: Path) -> None:
        (folder / name).unlink()
        (folder / name).mkdir()

    return apply


def as_parquet(name: str, *, keep: float = 1.0) -> Damage:
    """Write a table as Parquet beside it, whole or cut off."""

    def apply(folder: Path) -> None:
        import pandas as pd

        target = (folder / name).with_suffix(".parquet")
        pd.read_csv(folder / name).to_parquet(target, index=False)
        target.write_bytes(target.read_bytes()[: int(keep * target.stat().st_size)])

    return apply


def model(change: Callable[[dict[str, Any]], object]) -> Damage:
    """Write a good model file and change it."""

    def apply(folder: Path) -> None:
        import json

        from tests.fuzz.readers import READERS

        content = json.loads(READERS["model"].good)
        change(content)
        (folder / "model.json").write_text(json.dumps(content))

    return apply
