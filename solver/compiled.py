"""The one door to numba: compiled functions, kept between processes by all that they depend on.

numba's own cache knows the file of a function, not the files of the functions that it calls, nor
the compiler's settings: after a change, callers would silently keep old code. And it wants to write
where it reads. So code is kept by :mod:`solver.code_cache`, in a folder named after the sources of
all modules with compiled functions, the versions of numba and LLVM, the settings that change code,
and the processor. Where no folder can be used, each process compiles anew.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import platform
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeVar

# Intel's vector functions, where they are installed, would change bits from machine to machine.
os.environ["NUMBA_DISABLE_INTEL_SVML"] = "1"  # before numba is loaded

import llvmlite
import numba
import numpy as np
from llvmlite import binding
from numba.core import config as _config
from numba.core import event
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from solver.code_cache import CodeFiles, folder_name

F = TypeVar("F", bound=Callable[..., Any])
config: Any = _config  # its attributes are made at run time

# numba's settings that change code, as numba.core.config names them
_SETTINGS = (
    *("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "ENABLE_AVX", "USING_SVML", "BOUNDSCHECK"),
    *("DEBUGINFO_DEFAULT", "EXTEND_VARIABLE_LIFETIMES", "LLVM_REFPRUNE_PASS"),
    *("LLVM_REFPRUNE_FLAGS", "ENABLE_PROFILING", "DEBUG_NRT"),
)


def compiled(function: F) -> F:
    """Compile ``function`` at its first call (numba, nopython), keeping the result on disk.

    Division by zero gives inf or NaN, as in numpy: a test before every division would keep the
    loops out of vector registers.
    """
    return _compile(function, error_model="numpy")


def compiled_sums(function: F) -> F:
    """Compile ``function`` likewise, and let sums be taken in any order (vector registers)."""
    return _compile(function, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})


def compiled_finite_sums(function: F) -> F:
    """Compile ``function`` with sums in any order of numbers that are none of them NaN."""
    return _compile(function, fastmath={"reassoc", "nnan", "nsz", "contract"})


def _compile(function: F, **options: Any) -> F:
    dispatcher: Any = numba.njit(**options)(function)
    dispatcher._cache = _Kept(function)
    compiled_function: F = dispatcher
    return compiled_function


# ----------------------------------------------------------------------- what code depends on


def processor() -> str:
    """Return the processor's name as LLVM knows it, such as ``znver4``."""
    return str(config.CPU_NAME or binding.get_host_cpu_name())


def settings() -> dict[str, str]:
    """What machine code depends on besides its sources and the name of the processor."""
    features = config.CPU_FEATURES
    if features is None:
        features = binding.get_host_cpu_features().flatten()
    return {
        "python": ".".join(platform.python_version_tuple()[:2]),
        "numba": numba.__version__,
        "llvmlite": llvmlite.__version__,
        "numpy": ".".join(np.__version__.split(".")[:2]),
        "machine": binding.get_process_triple(),
        "features": str(features),
        **{name.lower(): _plain(getattr(config, name, "")) for name in _SETTINGS},
    }


def _plain(value: Any) -> str:
    return str(int(value)) if isinstance(value, int) else str(value)


@cache
def code_files(to_installation: bool = False) -> CodeFiles:
    """Where this process finds and keeps compiled code."""
    return CodeFiles(folder_name(settings(), processor()), to_installation)


# ------------------------------------------------------------------------------- the cache

_target: list[CodeFiles] = []


@contextmanager
def kept_in_installation() -> Iterator[None]:
    """While this lasts, new code is kept in the installation, if that can be written."""
    _target.append(code_files(to_installation=True))
    try:
        yield
    finally:
        _target.pop()


class _Kept:
    """What numba's dispatcher asks of a cache, for one function."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._name = f"{function.__module__}.{function.__qualname__}"

    @property
    def cache_path(self) -> str:
        """For numba's statistics."""
        return str(code_files().find(self._name) or "")

    def _file(self, signature: Any) -> str:
        return f"{self._name}-{hashlib.sha256(str(signature).encode()).hexdigest()[:16]}"

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Code of a signature, or None."""
        content = _files().read(self._file(signature))
        if content is None:
            return None
        target.refresh()
        try:
            state = pickle.loads(content)
        except Exception:  # a damaged file can raise anything; it is compiled and written anew
            return None
        return CompileResult._rebuild(target, *state)  # type: ignore[no-untyped-call]

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep the code of a signature."""
        if result.library.has_dynamic_globals:
            raise RuntimeError(f"{self._name} holds an address of this process and cannot be kept")
        content: bytes = dumps(result._reduce())  # type: ignore[no-untyped-call]
        _files().write(self._file(signature), content)

    def flush(self) -> None:
        """Nothing to forget: a change has another folder."""


def _files() -> CodeFiles:
    return _target[-1] if _target else code_files()


# ------------------------------------------------------------------------- watching the compiler


class Compilation(event.Listener):
    """Counts the functions that are compiled, and the time that it takes.

    Attributes
    ----------
    functions : int
        Compiled so far, each signature for itself.
    seconds, cpu_seconds : float
        Wall time, and CPU time of this process, without what is under way.

    Parameters
    ----------
    tell : callable
        Called with this each time a function is begun.
    """

    def __init__(self, tell: Callable[[Compilation], None] = lambda seen: None) -> None:
        self.functions = 0
        self.seconds = 0.0
        self.cpu_seconds = 0.0
        self._tell = tell
        self._depth = 0
        self._since = (0.0, 0.0)

    @property
    def under_way(self) -> float:
        """Wall time since the compiler was last called, in s; 0 if it is not at work."""
        return time.perf_counter() - self._since[0] if self._depth else 0.0

    def on_start(self, _: Any) -> None:
        """One more; a function compiles those that it calls."""
        if self._depth == 0:
            self._since = time.perf_counter(), time.process_time()
        self._depth += 1
        self._tell(self)

    def on_end(self, _: Any) -> None:
        """One is ready."""
        self._depth -= 1
        self.functions += 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._since[0]
            self.cpu_seconds += time.process_time() - self._since[1]


@contextmanager
def watch_compilation(
    tell: Callable[[Compilation], None] = lambda seen: None,
) -> Iterator[Compilation]:
    """Count what is compiled while this lasts; see :class:`Compilation`."""
    compilation = Compilation(tell)
    with event.install_listener("numba:compile", compilation):
        yield compilation
