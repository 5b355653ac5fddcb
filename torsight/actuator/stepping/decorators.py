"""The decorators of compiled functions, with types kept.

None may add in an order of the compiler's choice: a function that was just compiled and the same one from the disk had
been put together in two ways, and their sums ended in other digits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from torsight.core.compiled import njit

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compile for scalars and arrays; the machine code is kept on disk and the lock of the interpreter let go.

    A division by zero gives infinity, as in numpy.
    """
    return cast("F", njit(cache=True, nogil=True, error_model="numpy")(function))


def inlined(function: F) -> F:
    """Compile a small function into its callers."""
    return cast("F", njit(cache=True, nogil=True, error_model="numpy", forceinline=True)(function))
