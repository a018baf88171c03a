"""Compile functions with numba, by a changed ``compiler``, and cache the code on disk.

numba's own cache depends on the file of a function, but not on the files of the functions that it
calls, nor on the compiler's settings: after a change, callers would silently keep old code. It also
requires write access where it reads. ``disk_cache`` therefore keeps the code, in a folder named
after the sources of all modules with compiled functions, the versions of numba and LLVM, the
settings that change code, and the processor. Without a usable folder each process compiles anew.

numba links the code of a function into all its callers and optimises it there once more. Here only
short functions are linked; long ones are called by their symbol's name (:class:`_FunctionCache`).

No Python code runs between a call from Python and its result: a signal handler could raise in it,
where neither numba nor LLVM expects an exception, which would become another one, be lost, or end
the process. Hence results are boxed by C code alone (``compiler``), and functions are loaded and
compiled in a separate thread (``uninterrupted``).
"""

from __future__ import annotations

import hashlib
import os
import pickle
import platform
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

# Intel's vector functions, if installed, would change last bits from machine to machine.
os.environ["NUMBA_DISABLE_INTEL_SVML"] = "1"  # before numba is loaded

import llvmlite
import numba
import numpy as np
from llvmlite import binding
from numba.core import config as _config
from numba.core import event
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from adhesis.solver.runtime.compiler import Compiler
from adhesis.solver.runtime.disk_cache import CodeFiles, folder_name
from adhesis.solver.runtime.uninterrupted import uninterrupted

F = TypeVar("F", bound=Callable[..., Any])
config: Any = _config  # its attributes are made at run time

# Functions of up to so many instructions are copied into their callers, where they may be inlined.
# Longer ones are called: optimising them again in each caller takes four fifths of the time.
_LONGEST_COPIED = 300
_DIGEST = hashlib.sha256().digest_size  # bytes at the head of a file of code
# numba's settings that change code, as numba.core.config names them
_SETTINGS = (
    *("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "ENABLE_AVX", "USING_SVML", "BOUNDSCHECK"),
    *("DEBUGINFO_DEFAULT", "EXTEND_VARIABLE_LIFETIMES", "LLVM_REFPRUNE_PASS"),
    *("LLVM_REFPRUNE_FLAGS", "ENABLE_PROFILING", "DEBUG_NRT"),
)


def compiled(function: F) -> F:
    """Compile ``function`` at its first call (numba, nopython) and cache the code on disk.

    Division by zero gives inf or NaN, as in numpy: a test before every division would prevent
    vectorisation.
    """
    return _compile(function, error_model="numpy")


def compiled_for_both(function: F) -> F:
    """Compile ``function`` likewise, once for calls from Python and from compiled code.

    Functions with another decorator that are called from both are compiled twice.
    """
    return _compile(function, from_python=True, error_model="numpy")


def compiled_sums(function: F) -> F:
    """Compile ``function`` likewise, with sums taken in any order (vectorised).

    A loop that sums must not write to an array, too: where that array lies near another one in
    memory, LLVM's code goes through the loop without vectors, and the last bit of the sum would
    depend on addresses.
    """
    return _compile(function, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})


def compiled_finite_sums(function: F) -> F:
    """Compile ``function`` with sums taken in any order, assuming that no number is NaN."""
    return _compile(function, fastmath={"reassoc", "nnan", "nsz", "contract"})


def _compile(function: F, from_python: bool = False, **options: Any) -> F:
    options["pipeline_class"] = Compiler
    options["no_cfunc_wrapper"] = True  # the wrapper is for calls from C
    dispatcher: Any = numba.njit(**options)(function)
    dispatcher._cache = _FunctionCache(function)
    # Most functions are called by compiled ones alone, which need no wrapper to unpack objects.
    inner: Any = dispatcher
    dispatcher.compile = uninterrupted(dispatcher.compile)
    if not from_python:
        options["no_cpython_wrapper"] = True
        inner = numba.njit(**options)(function)
        inner._cache = _FunctionCache(function, "-inner")
        inner.compile = uninterrupted(inner.compile)
    template = inner.get_call_template

    def template_without_literals(args: Any, kws: Any) -> Any:
        unliteral: Any = numba.types.unliteral
        return template(
            tuple(unliteral(arg) for arg in args),
            {name: unliteral(arg) for name, arg in kws.items()},
        )

    # With literal types a function would be compiled anew for each constant argument.
    dispatcher.get_call_template = template_without_literals
    dispatcher.get_overload = inner.get_overload
    dispatcher.inner = inner
    compiled_function: F = dispatcher
    return compiled_function


# ------------------------------------------------------------------ dependencies of the code


def processor() -> str:
    """Return LLVM's name of the processor, such as ``znver4``."""
    return str(config.CPU_NAME or binding.get_host_cpu_name())


def settings() -> dict[str, str]:
    """Return the settings that change machine code, besides its sources and the processor."""
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
    """Return the folders in which this process finds and keeps compiled code."""
    return CodeFiles(folder_name(settings(), processor()), to_installation)


# ------------------------------------------------------------------------------- the cache

_target: list[CodeFiles] = []


@contextmanager
def kept_in_installation() -> Iterator[None]:
    """Keep new code in the installation, if it is writable, inside this context."""
    _target.append(code_files(to_installation=True))
    try:
        yield
    finally:
        _target.pop()


@dataclass(frozen=True)
class _Call:
    """A function and signature that other compiled code calls by a symbol's name."""

    module: str
    function: str
    signature: tuple[Any, ...]
    symbol: str

    def is_ready(self) -> bool:
        """Load or compile the function; True if it has the symbol that its callers use."""
        dispatcher: Any = getattr(sys.modules[self.module], self.function).inner
        dispatcher.compile(self.signature)
        found = dispatcher.overloads[self.signature].fndesc.llvm_func_name
        return bool(found == self.symbol)


def _calls_in(library: Any) -> list[_Call]:
    """Return the calls in a library's code, including those in code copied into it."""
    calls: dict[_Call, None] = {}
    for other in library._linking_libraries:
        known = getattr(other, "adhesis_calls", None)  # numba's own functions have none
        calls.update(dict.fromkeys(_calls_in(other) if known is None else known))
    return list(calls)


class _FunctionCache:
    """Cache of one function's code, with the interface that numba's dispatcher requires."""

    def __init__(self, function: Callable[..., Any], kind: str = "") -> None:
        self._module, self._function = function.__module__, function.__qualname__
        self._name = f"{self._module}.{self._function}{kind}"

    @property
    def cache_path(self) -> str:
        """Folder of the code, for numba's statistics."""
        return str(code_files().find(self._name) or "")

    def _file(self, signature: Any) -> str:
        return f"{self._name}-{hashlib.sha256(str(signature).encode()).hexdigest()[:16]}"

    def _digest(self, signature: Any, content: bytes) -> bytes:
        """Return the digest of the code of a signature, for this folder alone."""
        place = f"{code_files().name}/{self._file(signature)}\n"
        return hashlib.sha256(place.encode() + content).digest()

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Load the code of a signature; None if it is not cached."""
        content = _files().read(self._file(signature))
        if content is None:
            return None
        digest, content = content[:_DIGEST], content[_DIGEST:]
        if self._digest(signature, content) != digest:
            return None  # a damaged file, or one from another place: compiled and written anew
        target.refresh()
        symbols, calls, copied, state = pickle.loads(content)
        # the code that this code calls must be loaded before it, under the expected symbol
        if not all(call.is_ready() for call in calls):
            return None
        target.codegen()._engine._defined_symbols.update(symbols)
        # numba has no types
        result: Any = CompileResult._rebuild(target, *state)  # type: ignore[no-untyped-call]
        self._note(result, signature, calls, copied)
        return result

    def save_overload(self, signature: Any, result: Any) -> None:
        """Write the code of a signature to the cache."""
        library = result.library
        if library.has_dynamic_globals:
            raise RuntimeError(f"{self._name} holds an address of this process and cannot be kept")
        calls = _calls_in(library)
        own = library.get_function(result.fndesc.llvm_func_name)
        copied = sum(1 for block in own.blocks for _ in block.instructions) <= _LONGEST_COPIED
        if not copied:
            library._shared_module = binding.parse_assembly("")  # callers link nothing in
        self._note(result, signature, calls, copied)
        symbols = [
            function.name
            for function in library._final_module.functions
            if not function.is_declaration and function.linkage == binding.Linkage.external
        ]
        state = result._reduce()
        # numba has no types
        content: bytes = dumps((symbols, calls, copied, state))  # type: ignore[no-untyped-call]
        _files().write(self._file(signature), self._digest(signature, content) + content)

    def _note(self, result: Any, signature: Any, calls: list[_Call], copied: bool) -> None:
        """Attach to the code the calls that its callers inherit."""
        if not copied:
            symbol = result.fndesc.llvm_func_name
            calls = [_Call(self._module, self._function, tuple(signature), symbol)]
        result.library.adhesis_calls = calls

    def flush(self) -> None:
        """Do nothing: changed code has another folder."""


def _files() -> CodeFiles:
    return _target[-1] if _target else code_files()


# ------------------------------------------------------------------------ counting compilations


class Compilation(event.Listener):
    """Number of functions compiled, and the time that took.

    Attributes
    ----------
    functions : int
        Compiled so far, counted by signature.
    seconds, cpu_seconds : float
        Wall time, and CPU time of this process, in s, without the compilation under way.

    Parameters
    ----------
    report : callable
        Called with this object when the compilation of a function begins.
    """

    def __init__(self, report: Callable[[Compilation], None] = lambda seen: None) -> None:
        self.functions = 0
        self.seconds = 0.0
        self.cpu_seconds = 0.0
        self._report = report
        self._depth = 0
        self._since = (0.0, 0.0)

    @property
    def under_way(self) -> float:
        """Wall time of the compilation under way, in s; 0 if there is none."""
        return time.perf_counter() - self._since[0] if self._depth else 0.0

    def on_start(self, _: Any) -> None:
        """Count the start of a compilation; these nest, as a function compiles its callees."""
        if self._depth == 0:
            self._since = time.perf_counter(), time.process_time()
        self._depth += 1
        self._report(self)

    def on_end(self, _: Any) -> None:
        """Count a finished compilation."""
        self._depth -= 1
        self.functions += 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._since[0]
            self.cpu_seconds += time.process_time() - self._since[1]


@contextmanager
def watch_compilation(
    report: Callable[[Compilation], None] = lambda seen: None,
) -> Iterator[Compilation]:
    """Count the functions compiled inside this context; see :class:`Compilation`."""
    compilation = Compilation(report)
    with event.install_listener("numba:compile", compilation):
        yield compilation
