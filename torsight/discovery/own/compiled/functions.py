"""Models in plain Python as machine code: what numba can compile of a function and of what that calls.

A compiled function gets parameters and laws by name, as the plain one does. Whatever numba cannot compile stays as it
is; whether a compiled model gives the same is for the caller to check.
"""

from __future__ import annotations

import dis
import operator
import re
from collections.abc import Callable, Iterator
from types import CellType, CodeType, FunctionType
from typing import Any, Final

import numpy as np
from numba.core import types
from numba.core.cgutils import create_struct_proxy
from numba.core.typing.templates import signature
from numba.extending import (
    NativeValue,
    intrinsic,
    lower_builtin,
    make_attribute_wrapper,
    models,
    overload,
    overload_method,
    register_model,
    typeof_impl,
    unbox,
)
from numba.misc.special import literal_unroll

from torsight.core.compiled import njit
from torsight.discovery.own.model.values import KINDS, Curve


class CannotCompileError(Exception):
    """A function that cannot be compiled; the message is the reason, in one line."""


def reason_in(message: str) -> str:
    """Return the reason out of numba's error message, with the number of the line if the message names one."""
    # One "Failed in …" per function on the way; the reason comes after them, and may go on below a colon.
    lines = [line.strip() for line in message.splitlines() if line.strip() and not line.startswith("Failed in")]
    reason = " ".join(lines[:2]) if lines and lines[0].endswith(":") else "".join(lines[:1]) or message
    places = re.findall(r"line (\d+)", message)
    return f"{reason} (line {places[-1]})" if places else reason


_OUTSIDE: Final[dict[str, Any]] = {"nogil": True, "no_cfunc_wrapper": True}
_INSIDE: Final = {**_OUTSIDE, "no_cpython_wrapper": True}
"""Options for functions that only compiled code calls: wrappers for calls from Python and C took half of the compiler's
time, because parameters are passed by name."""


def inside(function: Callable[..., Any]) -> Any:
    """Compile a function of this package that only compiled code calls."""
    return njit(**_INSIDE)(function)


def compiled(function: Callable[..., Any], *, inner: bool = True, within: tuple[CodeType, ...] = ()) -> Any:
    """Return a function compiled, together with the plain functions that it calls by name.

    An ``inner`` function is called by compiled code alone.
    """
    if hasattr(function, "py_func"):
        return function
    if not isinstance(function, FunctionType):
        raise CannotCompileError(f"'{function!r}' is no function in Python")
    code = function.__code__
    names = set(_names(code))
    if code in within or "print" in names:
        raise CannotCompileError(f"'{function.__name__}' calls itself, or prints")

    def each(value: Any) -> Any:
        return compiled(value, within=(*within, code)) if isinstance(value, FunctionType) else value

    known = {name: each(value) for name, value in function.__globals__.items() if name in names}
    known["__builtins__"] = function.__globals__["__builtins__"]
    cells = tuple(CellType(each(cell.cell_contents)) for cell in function.__closure__ or ())
    made = FunctionType(code, known, function.__name__, function.__defaults__, cells)
    return njit(**(_INSIDE if inner else _OUTSIDE))(made)


def _names(code: CodeType) -> Iterator[str]:
    """Return the global names that a function uses, and the functions defined within it."""
    yield from (one.argval for one in dis.get_instructions(code) if one.opname in {"LOAD_GLOBAL", "LOAD_NAME"})
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


class _CurveType(types.Callable):
    """A law in compiled code: called with a number, it gives one."""

    def __init__(self) -> None:
        super().__init__(name="Curve")

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """Return the signature of a call with one number, None for other arguments."""
        del context
        number = len(args) == 1 and not kws and isinstance(args[0], (types.Float, types.Integer))
        return signature(types.float64, types.float64, recvr=self) if number else None

    def get_call_signatures(self) -> Any:
        """Return the only signature of a law."""
        return [signature(types.float64, types.float64)], False

    def get_impl_key(self, sig: Any) -> Any:
        """Return the key under which the code of a law is registered."""
        del sig
        return _CurveType


_CURVE = _CurveType()
_COLUMN = types.Array(types.float64, 1, "C")
_MEMBERS = ("nodes", "values", "asked")


@typeof_impl.register(Curve)
def _type_of(value: Any, context: Any) -> Any:
    del value, context
    return _CURVE


@register_model(_CurveType)
class _CurveModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [(name, _COLUMN) for name in _MEMBERS])


for _name in _MEMBERS:
    make_attribute_wrapper(_CurveType, _name, _name)


@unbox(_CurveType)
def _unboxed(kind: Any, value: Any, c: Any) -> Any:
    made = create_struct_proxy(kind)(c.context, c.builder)
    for name in _MEMBERS:
        member = c.pyapi.object_getattr_string(value, name)
        setattr(made, name, c.unbox(_COLUMN, member).value)
        c.pyapi.decref(member)
    return NativeValue(made._getvalue())  # noqa: SLF001 - numba's own way


@intrinsic
def curve_at(context: Any, nodes: Any, values: Any, asked: Any) -> Any:
    """Make a law within compiled code, from its nodes, its values there and the range of its arguments so far."""
    del context

    def made(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        curve = create_struct_proxy(_CURVE)(context, builder)
        for name, kind, value in zip(_MEMBERS, sig.args, args, strict=True):
            context.nrt.incref(builder, kind, value)
            setattr(curve, name, value)
        return curve._getvalue()  # noqa: SLF001 - numba's own way

    return _CURVE(nodes, values, asked), made


@lower_builtin(_CurveType, _CurveType, types.float64)
def _called(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    def value(curve: Any, at: float) -> float:
        curve.asked[0], curve.asked[1] = min(curve.asked[0], at), max(curve.asked[1], at)
        nodes, values = curve.nodes, curve.values
        low = np.searchsorted(nodes, at, side="right") - 1
        if low < 0 or low == len(nodes) - 1:
            return float(values[max(low, 0)])
        share = (at - nodes[low]) / (nodes[low + 1] - nodes[low])
        return float(values[low] + share * (values[low + 1] - values[low]))

    return context.compile_internal(builder, value, sig, args)


_BY_NAME = (types.NamedTuple, types.NamedUniTuple)


def _place(values: Any, name: Any) -> int | None:
    """Return the index of the value that a literal names, None where there is none."""
    known = isinstance(name, types.StringLiteral) and values.instance_class in KINDS.values()
    return values.fields.index(name.literal_value) if known and name.literal_value in values.fields else None


@overload(operator.getitem, prefer_literal=True)
def _item(values: Any, name: Any) -> Any:
    """Let ``p["name"]`` be what ``p.name`` is."""
    place = _place(values, name) if isinstance(values, _BY_NAME) else None

    def item(values: Any, name: Any) -> Any:  # noqa: ARG001 - numba wants both names
        return values[place]

    return None if place is None else item


def _get(values: Any, name: Any, default: Any = None) -> Any:
    """Let ``p.get("name", value)`` be what it is for a mapping."""
    del default
    place = _place(values, name)

    def get(values: Any, name: Any, default: Any = None) -> Any:  # noqa: ARG001
        return values[place]

    def without(values: Any, name: Any, default: Any = None) -> Any:  # noqa: ARG001
        return default

    return without if place is None else get


for _kind in _BY_NAME:
    overload_method(_kind, "get", prefer_literal=True)(_get)


def fill(out: Any, values: Any) -> None:
    """Write values, be they a tuple of numbers of any kind, a list or an array, into an array."""
    out[:] = values


@overload(fill)
def _fill(out: Any, values: Any) -> Any:  # noqa: ARG001
    if isinstance(values, types.BaseTuple):

        def unrolled(out: Any, values: Any) -> None:
            place = 0
            for one in literal_unroll(values):
                out[place] = one
                place += 1  # noqa: SIM113 - what is unrolled is not counted by enumerate

        return unrolled

    def looped(out: Any, values: Any) -> None:
        for place in range(len(out)):
            out[place] = values[place]

    return looped


@overload_method(types.Array, "tolist")
def _to_list(array: Any) -> Any:
    """Let a loop over ``array.tolist()``, which is fast in plain Python, be compiled."""
    if array.ndim != 1:
        return None

    def to_list(array: Any) -> Any:
        return [one for one in array]  # noqa: C416 - numba knows no list(array)

    return to_list
