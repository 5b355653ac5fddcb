"""numba's ``njit``, with cached machine code that is never older than the sources.

numba inlines compiled functions and constants into their callers, but its cache checks only whether the caller's own
file has changed: after an update in place, callers would still use old code and old constants. So importing this module
checks whether any source of a compiled function, or a module that such a source imports, has changed since the code was
cached, and deletes the cache if so. Modules that import from this one count as sources of compiled functions.

The wrapper that lets Python call a function unpacks its tuples of records one by one. Functions that only compiled code
calls (:func:`internal`, :func:`lending`) have no wrapper, which saves a tenth of the compile time.

A call with a literal number is compiled for the number's type: numba would compile the function again for each literal,
which took another tenth.

No function may leave the order of additions to the compiler: a function that was compiled anew and the same function
from the cache had different orders, and their sums differed in the last digits.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba
import numpy as np
from llvmlite.binding import parse_bitcode
from numba import njit, types
from numba.core import entrypoints, environment
from numba.core.caching import FunctionCache
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.dispatcher import Dispatcher
from numba.core.environment import Environment
from numba.core.options import DefaultOptions
from numba.core.registry import CPUDispatcher
from numba.core.runtime.nrt import rtsys
from numpy.typing import NDArray

from torsight.core.lazy import scipy_extension

__all__ = ["compiled", "copy_to", "inlined", "internal", "lending", "njit", "numbers", "shared"]

F = TypeVar("F", bound=Callable[..., object])


_KEPT: Final[dict[str, Any]] = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""Options without the wrapper for calls from C: nothing uses it, and it takes as long to compile as the function."""
_INTERNAL: Final = {**_KEPT, "no_cpython_wrapper": True}
"""Options without the wrapper for calls from Python, either."""
_UNCOUNTED: Final[dict[str, Any]] = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}
"""numba's option to leave out its memory manager; a numba without this option gives the same results, more slowly."""


LOADING: Final = ("0.68",)
"""Versions of numba for which the requirements for loading cached code are known; others load it in their own way."""
_LOADS: Final = numba.__version__.rpartition(".")[0] in LOADING


class _Kept(FunctionCache):
    """Cached machine code, loaded without setting up numba's compiler.

    Before numba reads the cache it sets up its compiler, with its implementations of all of numpy and Python, and looks
    for its extensions among all installed packages: a quarter of the start-up time of tracking. Cached code needs
    numba's memory manager alone; where nothing is cached, compiling sets up the compiler anyway.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for a signature, or None."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            load: Any = self._load_overload
            found = load(sig, target_context)
        if found is None:
            set_up: Any = entrypoints.init_all
            set_up()
            lend_blas()
        return found


class _Library(JITCodeLibrary):
    """The machine code of a function; of cached code, only what it takes to run it is read.

    Numba also parses the bitcode from which callers are compiled, and lists its symbols: more than half of the time of
    loading. Here that happens where a caller is compiled.
    """

    _cached: tuple[bytes, bytes] | None = None
    """Object code and bitcode."""

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, Any]) -> Any:
        name, kind, data = state
        return codegen.create_library(name).load(data) if kind == "object" else super()._unserialize(codegen, state)

    def load(self, data: tuple[bytes, bytes]) -> _Library:
        """Make the machine code of cached data callable."""
        self._cached = data
        self.enable_object_caching()
        self._set_compiled_object(data[0])
        self._finalize_final_module()
        return self

    def _get_module_for_linking(self) -> Any:
        if self._cached is not None and self._shared_module is None:
            self._shared_module = parse_bitcode(self._cached[1])
        return super()._get_module_for_linking()

    def get_pointer_to_function(self, name: str) -> Any:
        """Return the address of a function, 0 if there is none of that name."""
        if self._cached is None:
            return super().get_pointer_to_function(name)
        # The object code lists its symbols, each with a zero at its end.
        known = name.encode() + b"\0" in self._cached[0]
        return vars(self._codegen)["_engine"].get_function_address(name) if known else 0


_MADE: Final[Any] = vars(Environment)["_memo"]
_REBUILD: Final[Any] = vars(environment)["_rebuild_env"]


def _without_its_module(module: str, constants: Sequence[object], name: str) -> object:
    """Return the environment ``name`` of a function of numba's own in cached code, without importing its module.

    Machine code uses the constants; the module has the names that a function without machine code would look up.
    """
    if module.startswith("numba.") and module not in sys.modules and name not in _MADE:
        made: Any = Environment({"__name__": module})
        made.consts[:], made.env_name = constants, name
        _MADE[name] = made
    return _REBUILD(module, constants, name)


class _Internal(CPUDispatcher):
    """A function that only compiled code may call: a call from Python would jump to a missing wrapper."""

    def __call__(self, *_: object, **__: object) -> None:
        """Refuse the call."""
        raise TypeError(
            f"{self.py_func.__name__} is there for compiled callers: @compiled and @shared let Python call it, too"
        )


def _prepared(function: Any) -> Any:
    """Return a compiled function with this module's changes: fast loading from the cache, types without literals."""
    if not isinstance(function, Dispatcher):
        return function  # numba's compilation is disabled
    kept = vars(function).get("_cache")
    if type(kept) is FunctionCache and _LOADS:
        kept.__class__ = _Kept
        vars(function)["_compilation_chain_init_hook"] = lambda: None
    ask: Any = function.get_call_template
    plain: Any = types.unliteral

    def ask_for_types(args: Sequence[types.Type], kws: Mapping[str, types.Type]) -> object:
        return ask([plain(one) for one in args], {name: plain(one) for name, one in kws.items()})

    vars(function)["get_call_template"] = ask_for_types
    return function


def compiled(function: F) -> F:
    """Compile for scalars and arrays; the machine code is cached on disk and runs without the interpreter's lock.

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
    """Compile as :func:`internal` a function that neither creates nor keeps arrays: it borrows those of its callers.

    References to these arrays are not counted. Counting is an atomic instruction at every call and every field of a
    tuple of arrays: it took two thirds of the stepping's time (benchmarks/actuator/speed.py).
    """
    return internal(function, **_UNCOUNTED)


def shared(function: F) -> F:
    """Compile as :func:`lending` a function that Python calls, too."""
    return cast("F", _prepared(njit(**_KEPT | _UNCOUNTED)(function)))


def inlined(function: F) -> F:
    """Compile a small function that creates no array, inlined into its callers."""
    return cast("F", _prepared(njit(forceinline=True, **_KEPT | _UNCOUNTED)(function)))


@inlined
def copy_to(into: NDArray[Any], values: NDArray[Any]) -> None:
    """Copy values (n,) into an array of the same length that does not overlap them.

    ``into[:] = values`` checks both shapes, and the message of its error took a seventh of the compile time. No user
    could cause this error: the shapes are the code's own.
    """
    for i in range(len(into)):
        into[i] = values[i]


def numbers(names: str) -> np.dtype[np.void]:
    """Return the type of a record of numbers, by their names."""
    return np.dtype([(name, np.float64) for name in names.split()])


_TORSIGHT: Final = Path(__file__).resolve().parents[1]
FOLDERS: Final = (
    *(_TORSIGHT / name for name in ("actuator", "synthetic", "discovery/inference", "discovery/own")),
    _TORSIGHT.parent / "tracker",
)
_COMPILED: Final = re.compile(rb"^from torsight\.core\.compiled import ", re.MULTILINE)
_IMPORT: Final = re.compile(rb"^(?:from|import) ([\w.]+)", re.MULTILINE)


def sources(folders: Iterable[Path], root: Path) -> dict[Path, bytes]:
    """Return the compiled sources in the folders, and the modules in ``root`` that they import, with their contents."""
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
    """Delete the cached machine code in the folders if its sources differ from those of the stamp; return whether.

    ``root`` is the folder of the packages from which the sources import.
    """
    folders = list(folders)
    noted: list[str] = []
    with contextlib.suppress(OSError):
        noted = stamp.read_text(encoding="utf-8").splitlines()
    known, written, *imported = noted + [""] * (2 - len(noted))
    # Files with unchanged time and size are not read: reading all of them would dominate the start-up time.
    if _written(folders, imported) == written:
        return False
    contents = sorted(sources(folders, root).items())
    made_of = hashlib.sha256(b"\0".join(path.name.encode() + b"\0" + content for path, content in contents)).hexdigest()
    imported = [str(path) for path, _ in contents if not any(path.is_relative_to(folder) for folder in folders)]
    # Where nothing can be written nothing was cached either. Another process may be doing the same.
    with contextlib.suppress(OSError):
        for path in [path for folder in folders for path in folder.rglob("*.nb[ic]")] if made_of != known else ():
            path.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text("\n".join([made_of, _written(folders, imported), *imported]), encoding="utf-8")
    return made_of != known


def _written(folders: Iterable[Path], imported: Iterable[str]) -> str:
    """Return a digest of the modification times and sizes of all sources in the folders and of imported modules."""
    seen = [stats for folder in folders if folder.is_dir() for stats in _stats_below(folder)]
    for path in map(Path, imported):
        if path.is_file():
            stat = path.stat()
            seen.append((str(path), stat.st_mtime_ns, stat.st_size))
    return hashlib.sha256("\n".join(f"{path} {time} {size}" for path, time, size in sorted(seen)).encode()).hexdigest()


def _stats_below(folder: Path | str) -> Iterator[tuple[str, int, int]]:
    """Yield path, modification time (ns) and size of each source in a folder; pathlib takes six times as long."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir() and entry.name != "__pycache__":
                yield from _stats_below(entry.path)
            elif entry.name.endswith(".py"):
                stat = entry.stat()
                yield entry.path, stat.st_mtime_ns, stat.st_size


def lend_blas() -> None:
    """Load the BLAS that numba's compiler needs: numba would import all of ``scipy.linalg``, which takes longer."""
    # Where only SciPy itself finds the libraries of the extension, numba imports all of SciPy as usual.
    with contextlib.suppress(ImportError):
        scipy_extension("scipy.linalg.cython_blas")


if _LOADS:
    # Cached code names the function by which it rebuilds environments.
    vars(environment)["_rebuild_env"] = _without_its_module
    JITCPUCodegen._library_class = _Library  # noqa: SLF001 - numba has no other way to name it
else:
    lend_blas()
drop_outdated(FOLDERS, _TORSIGHT / "core" / "__pycache__" / "compiled.stamp", root=_TORSIGHT.parent)
