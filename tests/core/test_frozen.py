"""Mappings of frozen objects: they cannot be changed, and travel between processes as they are."""

from __future__ import annotations

import copy
import importlib
import inspect
import json
import pickle
import pkgutil
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest

import calibration
import sync
import torsight.actuator
import torsight.core
import torsight.synthetic
import tracker
from torsight.core.frozen import Frozen
from torsight.core.records import TemperatureLog


@dataclass(frozen=True, slots=True)
class Specified(Frozen):
    values: dict[str, Any] = field(default_factory=dict)


GIVEN = {"a": 1.0, "table": {"b": 2.0}}


def changes() -> Iterator[Any]:
    yield lambda values: values.update(a=2.0)
    yield lambda values: values.__setitem__("a", 2.0)
    yield lambda values: values.__delitem__("a")
    yield lambda values: values.pop("a")
    yield lambda values: values.clear()
    yield lambda values: values.setdefault("c", 3.0)
    yield lambda values: values["table"].__setitem__("b", 3.0)
    yield lambda values: values.__ior__({"a": 2.0})


@pytest.mark.parametrize("change", list(changes()))
def test_a_mapping_of_a_frozen_object_refuses_changes(change: Any) -> None:
    made = Specified(GIVEN)
    with pytest.raises(TypeError, match="belongs to a frozen object"):
        change(made.values)
    assert made.values == GIVEN


def test_what_was_given_can_be_changed_and_does_not_reach_the_object() -> None:
    given = {"a": 1.0}
    made = Specified(given)
    given["a"] = 2.0
    assert made.values["a"] == 1.0
    for own in (dict(made.values), made.values.copy(), copy.deepcopy(made.values), made.values | {}):
        own["a"] = 3.0
    assert replace(made, values={**made.values, "a": 4.0}).values["a"] == 4.0
    assert made.values["a"] == 1.0


def test_it_is_pickled_and_written_as_a_dict_is() -> None:
    made = Specified(GIVEN)
    again = pickle.loads(pickle.dumps(made))  # noqa: S301 - our own bytes
    assert again == made
    with pytest.raises(TypeError):
        again.values["a"] = 2.0
    assert json.loads(json.dumps(made.values)) == GIVEN


def test_an_array_of_a_frozen_object_refuses_changes_and_is_its_own() -> None:
    time_s, given = np.arange(3.0), np.array([23.0, 24.0, 25.0])
    log = TemperatureLog(time_s, given, given, extra={"current_a_a": given})
    given[0] = 60.0
    for values in (log.temp_a_c, log.extra["current_a_a"], pickle.loads(pickle.dumps(log)).temp_a_c):  # noqa: S301 - our own bytes
        assert values[0] == 23.0
    for values in (log.time_s, log.temp_a_c, log.extra["current_a_a"]):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 3.0


def frozen_with_mappings() -> Iterator[type]:
    for package in (torsight.core, torsight.actuator, torsight.synthetic, sync, tracker, calibration):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            module = importlib.import_module(found.name)
            for _, one in inspect.getmembers(module, inspect.isclass):
                own = one.__module__ == module.__name__ and is_dataclass(one)
                if own and one.__dataclass_params__.frozen and any("apping[" in str(f.type) for f in fields(one)):
                    yield one


def test_every_frozen_dataclass_with_a_mapping_is_frozen_inside() -> None:
    found = list(frozen_with_mappings())
    assert len(found) > 15
    assert [one.__qualname__ for one in found if not issubclass(one, Frozen)] == []
