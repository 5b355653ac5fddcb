"""numba's ``njit``, with machine code on the disk that is never older than the sources.

numba puts compiled functions and constants into their callers, but its cache checks only whether the caller's own file
has changed: after an update in place, callers would go on with old code and old constants. So importing this module
checks whether any source of a compiled function, or a module that it imports, has changed since the cached code was
made, and deletes the cache if so. A source of compiled functions is one that imports from here.

The wrapper that lets Python call a function unpacks its tuples of records one by one. Functions that only compiled code
calls (:func:`internal`, :func:`lending`) get none, which saves a tenth of the time to compile.

A call with a literal number is compiled for the number's type: numba would compile the function again for each literal,
which took another tenth.

No function may leave the order of additions to the compiler: the same function, compiled now and taken from the cache,
had been put together in two ways, and their sums differed in the last digits.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, FileFinder
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba
from numba import njit, types
from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher
from numba.core.options import DefaultOptions
from numba.core.registry import CPUDispatcher
from numba.core.runtime.nrt import rtsys
from numpy.typing import NDArray

__all__ = ["compiled", "copy_to", "inlined", "internal", "lending", "njit", "shared"]

F = TypeVar("F", bound=Callable[..., object])


_KEPT: Final[dict[str, Any]] = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""Without the wrapper for calls from C: nothing uses it, and it is compiled and optimised like the function itself."""
_INTERNAL: Final = {**_KEPT, "no_cpython_wrapper": True}
"""Without the wrapper for calls from Python, too."""
_UNCOUNTED: Final[dict[str, Any]] = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}
"""With numba's option to leave out its memory manager; a numba without it compiles the same, only slower."""


LOADING: Final = ("0.68",)
"""Versions of numba for which it is known what cached code needs to be loaded; others load it in their own way."""


class _Kept(FunctionCache):
    """Cached machine code, loaded without all that numba needs to compile.

    Before numba looks into the cache it sets up its compiler, with how all of numpy and Python is compiled: a sixth of
    the time that it takes to start following a film. Cached code needs numba's memory manager alone; where nothing is
    cached, compiling sets up the compiler anyhow.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for a signature, or None."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            load: Any = self._load_overload
            return load(sig, target_context)


class _Internal(CPUDispatcher):
    """A function that only compiled code may call: a call from Python would jump to a wrapper that is not there."""

    def __call__(self, *_: object, **__: object) -> None:
        """Refuse the call."""
        raise TypeError(
            f"{self.py_func.__name__} is there for compiled callers: @compiled and @shared let Python call it, too"
        )


def _prepared(function: Any) -> Any:
    """Return a function of numba's with the changes made here: how its cache is loaded, for which types it compiles."""
    kept = vars(function).get("_cache") if isinstance(function, Dispatcher) else None
    if type(kept) is FunctionCache and numba.__version__.rpartition(".")[0] in LOADING:
        kept.__class__ = _Kept
    return _for_types(function)


def _for_types(function: Any) -> Any:
    """Let compiled callers look a function up by the types of its arguments, not by literal numbers."""
    if not isinstance(function, Dispatcher):
        return function  # numba was told to compile nothing
    ask: Any = function.get_call_template
    plain: Any = types.unliteral

    def ask_for_types(args: Sequence[types.Type], kws: Mapping[str, types.Type]) -> object:
        return ask([plain(one) for one in args], {name: plain(one) for name, one in kws.items()})

    vars(function)["get_call_template"] = ask_for_types
    return function


def compiled(function: F) -> F:
    """Compile for scalars and arrays; the machine code is kept on disk and the lock of the interpreter let go.

    A division by zero gives infinity, as in numpy.
    """
    return cast("F", _prepared(njit(**_KEPT)(function)))


def internal(function: F, **options: Any) -> F:
    """Compile as :func:`compiled` a function that only compiled code calls; ``options`` are numba's."""
    made = _prepared(njit(**_INTERNAL | options)(function))
    if isinstance(made, CPUDispatcher):
        made.__class__ = _Internal
    return cast("F", made)


def lending(function: F) -> F:
    """Compile as :func:`internal` a function that makes no array and keeps none: its callers lend it theirs.

    References to them are not counted. Counting is an atomic instruction at every call and every field of a tuple of
    arrays: it took two thirds of the stepping's time (benchmarks/actuator/speed.py).
    """
    return internal(function, **_UNCOUNTED)


def shared(function: F) -> F:
    """Compile as :func:`lending` a function that Python calls, too."""
    return cast("F", _prepared(njit(**_KEPT | _UNCOUNTED)(function)))


def inlined(function: F) -> F:
    """Compile a small function, one that makes no array, into its callers."""
    return cast("F", _prepared(njit(forceinline=True, **_KEPT | _UNCOUNTED)(function)))


@inlined
def copy_to(into: NDArray[Any], values: NDArray[Any]) -> None:
    """Copy values (n,) into an array of that length which does not overlap them.

    ``into[:] = values`` checks both shapes and raises with a message that names them. To compile the message took a
    seventh of the time to compile, and nobody would read it: the shapes are the code's own.
    """
    for i in range(len(into)):
        into[i] = values[i]


_TORSIGHT: Final = Path(__file__).resolve().parents[1]
FOLDERS: Final = (
    *(_TORSIGHT / name for name in ("actuator", "synthetic", "discovery/inference", "discovery/own")),
    _TORSIGHT.parent / "tracker",
)
_COMPILED: Final = re.compile(rb"^from torsight\.core\.compiled import ", re.MULTILINE)
_IMPORT: Final = re.compile(rb"^(?:from|import) ([\w.]+)", re.MULTILINE)


def sources(folders: Iterable[Path], root: Path) -> dict[Path, bytes]:
    """Return the compiled sources below folders and what they import from below the root, with their contents."""
    found: dict[Path, bytes] = {}
    contents = ((path, path.read_bytes()) for folder in folders for path in folder.rglob("*.py"))
    new = {path: content for path, content in contents if _COMPILED.search(content)}
    while new:
        found |= new
        names = {name.decode() for content in new.values() for name in _IMPORT.findall(content)}
        modules = {root.joinpath(*name.split(".")) for name in names}
        paths = {module.with_suffix(".py") for module in modules} | {module / "__init__.py" for module in modules}
        new = {path: path.read_bytes() for path in paths if path not in found and path.is_file()}
    return found


def drop_outdated(folders: Iterable[Path], stamp: Path, *, root: Path) -> bool:
    """Delete machine code below folders where its sources are not those of the stamp; return whether.

    ``root`` is where the packages lie that the sources import from.
    """
    folders = list(folders)
    noted: list[str] = []
    with contextlib.suppress(OSError):
        noted = stamp.read_text(encoding="utf-8").splitlines()
    known, written, *imported = noted + [""] * (2 - len(noted))
    # What is as it was written last needs no reading, which takes longer than to start without it.
    if _written(folders, imported) == written:
        return False
    contents = sorted(sources(folders, root).items())
    made_of = hashlib.sha256(b"\0".join(path.name.encode() + b"\0" + content for path, content in contents)).hexdigest()
    imported = [str(path) for path, _ in contents if not any(path.is_relative_to(folder) for folder in folders)]
    # Where nothing can be written nothing was kept either. Another process may be doing the same.
    with contextlib.suppress(OSError):
        for path in [path for folder in folders for path in folder.rglob("*.nb[ic]")] if made_of != known else ():
            path.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text("\n".join([made_of, _written(folders, imported), *imported]), encoding="utf-8")
    return made_of != known


def _written(folders: Iterable[Path], imported: Iterable[str]) -> str:
    """Return a digest of modification times and sizes of all sources below folders and of those they import."""
    below = (path for folder in folders for path in folder.rglob("*.py"))
    stats = {path: path.stat() for path in sorted([*below, *map(Path, imported)]) if path.is_file()}
    seen = [f"{path} {stat.st_mtime_ns} {stat.st_size}" for path, stat in stats.items()]
    return hashlib.sha256("\n".join(seen).encode()).hexdigest()


def lend_blas() -> None:
    """Load the one extension of SciPy that numba needs at start-up, without the package around it.

    Numba checks for a BLAS by importing all of ``scipy.linalg``: a third of the time that it takes to start following a
    film. The extension by itself needs nothing of that.
    """
    name, package = "scipy.linalg.cython_blas", importlib.util.find_spec("scipy")
    if name in sys.modules or package is None:
        return
    for folder in package.submodule_search_locations or ():
        finder = FileFinder(str(Path(folder) / "linalg"), (ExtensionFileLoader, EXTENSION_SUFFIXES))
        spec = finder.find_spec(name)
        if spec is not None and spec.loader is not None:
            # Where the libraries that it needs are found by SciPy only, numba imports all of it as ever.
            with contextlib.suppress(ImportError):
                module = importlib.util.module_from_spec(spec)
                spec.loader.exec_module(module)
                sys.modules[name] = module
            return


lend_blas()
drop_outdated(FOLDERS, _TORSIGHT / "core" / "__pycache__" / "compiled.stamp", root=_TORSIGHT.parent)
