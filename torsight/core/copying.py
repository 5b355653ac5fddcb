"""Copying from one array into another in compiled code.

``into[:] = values`` asks whether both have one shape; where they have not, numba says so in a message that names both.
To compile what writes the message took a seventh of all compiling, and nobody reads it: the shapes are the code's own.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from torsight.core.compiled import inlined


@inlined
def copy_to(into: NDArray[Any], values: NDArray[Any]) -> None:
    """Copy values (n,) into an array of that length that holds none of them."""
    for i in range(len(into)):
        into[i] = values[i]
