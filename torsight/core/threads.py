"""Results that do not depend on the number of threads."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_thread() -> Iterator[None]:
    """Give a context in which linear algebra uses one thread.

    Several add up in another order: the last digits differ, and a search that decides by them may end elsewhere. The
    matrices here are small; what runs in parallel are whole fits.
    """
    with threadpool_limits(limits=1, user_api="blas"):
        yield
