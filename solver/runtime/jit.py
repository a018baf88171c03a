"""The one door to numba: compiled functions, kept between processes by all that they depend on.

numba's own cache knows the file of a function, not the files of the functions that it calls, nor
the compiler's settings: after a change, callers would silently keep old code. And it wants to write
where it reads. So code is kept by ``disk_cache``, in a folder named after
the sources of all modules with compiled functions, the versions of numba and LLVM, the settings
that change code, and the processor. Where no folder can be used, each process compiles anew.

numba links the code of a function into all its callers and optimises it there once more. Here that
is left to short functions; long ones are called under their symbol's name (:class:`_Kept`).

Between a call from Python and its result no Python code runs, for a signal handler might raise in
it, where neither numba nor LLVM expects an exception: it would become another one, be lost, or end
the process. Hence results are boxed by C code alone (:func:`_box_array`), and functions are loaded
and compiled in a thread of their own (``uninterrupted``).
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

# Intel's vector functions, where they are installed, would change bits from machine to machine.
os.environ["NUMBA_DISABLE_INTEL_SVML"] = "1"  # before numba is loaded

import llvmlite
import numba
import numpy as np
from llvmlite import binding
from numba.core import boxing, event, pythonapi, types
from numba.core import config as _config
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps
from numba.extending import overload
from numba.np import arrayobj

from adhesis.solver.runtime.disk_cache import CodeFiles, folder_name
from adhesis.solver.runtime.uninterrupted import uninterrupted

F = TypeVar("F", bound=Callable[..., Any])
config: Any = _config  # its attributes are made at run time

# numba's settings that change code, as numba.core.config names them
# Functions of up to so many instructions are copied into their callers, where they may be inlined.
# Longer ones are called: or each caller would optimise them all over again, and its own callers
# them and it, which takes four fifths of the time to compile.
_LONGEST_COPIED = 300
_DIGEST = hashlib.sha256().digest_size  # bytes at the head of a file of code
_SETTINGS = (
    *("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "ENABLE_AVX", "USING_SVML", "BOUNDSCHECK"),
    *("DEBUGINFO_DEFAULT", "EXTEND_VARIABLE_LIFETIMES", "LLVM_REFPRUNE_PASS"),
    *("LLVM_REFPRUNE_FLAGS", "ENABLE_PROFILING", "DEBUG_NRT"),
)


def _shapes_differ(source: Any, target: Any) -> None:
    """Raise that a slice cannot be assigned; a name for what compiled code does."""
    raise NotImplementedError


@overload(_shapes_differ)
def _shapes_differ_compiled(source: Any, target: Any) -> Any:
    def plainly(source: Any, target: Any) -> None:
        raise ValueError("cannot assign a slice from an array of another shape")

    return plainly


# numba's own message tells the shapes, for which half of Python's strings are compiled: 3.5 s.
if hasattr(arrayobj, "raise_with_shape_context"):
    arrayobj.raise_with_shape_context = _shapes_differ


# ------------------------------------------------------------------- results handed to Python


def _constant(c: Any, value: Any) -> Any:
    """Read ``value``, which is kept with the compiled function; a borrowed reference."""
    return c.env_manager.read_const(c.env_manager.add_const(value))


def _box_array(typ: Any, val: Any, c: Any) -> Any:
    """Box an array as numba does, with its class kept as a constant.

    numba unpickles the class at each call, by a function in Python.
    """
    api = c.pyapi
    api.serialize_object = lambda value: value
    api.unserialize = lambda value: _constant(c, value)
    try:
        return boxing.box_array(typ, val, c)
    finally:
        del api.serialize_object, api.unserialize


def _box_named_tuple(typ: Any, val: Any, c: Any) -> Any:
    """Box a named tuple of this package by ``tuple.__new__``, as its own ``_make`` does.

    numba calls the class, which is a function in Python.
    """
    if not typ.instance_class.__module__.startswith("adhesis.solver."):
        return boxing.box_namedtuple(typ, val, c)
    values = boxing.box_tuple(typ, val, c)
    new, named = _constant(c, tuple.__new__), _constant(c, typ.instance_class)
    result = c.pyapi.call_function_objargs(new, (named, values))
    c.pyapi.decref(values)
    return result


pythonapi._boxers.functions.update(
    {
        types.Array: _box_array,
        types.NamedTuple: _box_named_tuple,
        types.NamedUniTuple: _box_named_tuple,
    }
)


def compiled(function: F) -> F:
    """Compile ``function`` at its first call (numba, nopython), keeping the result on disk.

    Division by zero gives inf or NaN, as in numpy: a test before every division would keep the
    loops out of vector registers.
    """
    return _compile(function, error_model="numpy")


def compiled_for_both(function: F) -> F:
    """Compile likewise what is called from Python as often as from compiled code: once for both.

    Others called from both are compiled twice.
    """
    return _compile(function, from_python=True, error_model="numpy")


def compiled_sums(function: F) -> F:
    """Compile ``function`` likewise, and let sums be taken in any order (vector registers)."""
    return _compile(function, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})


def compiled_finite_sums(function: F) -> F:
    """Compile ``function`` with sums in any order of numbers that are none of them NaN."""
    return _compile(function, fastmath={"reassoc", "nnan", "nsz", "contract"})


def _compile(function: F, from_python: bool = False, **options: Any) -> F:
    options["no_cfunc_wrapper"] = True  # that is for calls from C
    dispatcher: Any = numba.njit(**options)(function)
    dispatcher._cache = _Kept(function)
    # Most functions are called by compiled ones alone, which need nothing to unpack objects.
    inner: Any = dispatcher
    dispatcher.compile = uninterrupted(dispatcher.compile)
    if not from_python:
        options["no_cpython_wrapper"] = True
        inner = numba.njit(**options)(function)
        inner._cache = _Kept(function, "-inner")
        inner.compile = uninterrupted(inner.compile)
    template = inner.get_call_template

    def of_any_value(args: Any, kws: Any) -> Any:
        unliteral: Any = numba.types.unliteral
        return template(
            tuple(unliteral(arg) for arg in args),
            {name: unliteral(arg) for name, arg in kws.items()},
        )

    # otherwise a function is compiled once more for each number that stands in a call
    dispatcher.get_call_template = of_any_value
    dispatcher.get_overload = inner.get_overload
    dispatcher.inner = inner
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


@dataclass(frozen=True)
class _Call:
    """A function with a signature that other compiled code calls under a symbol's name."""

    module: str
    function: str
    signature: tuple[Any, ...]
    symbol: str

    def is_ready(self) -> bool:
        """Load it, or compile it; whether it has the name under which it is called."""
        dispatcher: Any = getattr(sys.modules[self.module], self.function).inner
        dispatcher.compile(self.signature)
        found = dispatcher.overloads[self.signature].fndesc.llvm_func_name
        return bool(found == self.symbol)


def _calls_in(library: Any) -> list[_Call]:
    """Return the calls in a library's code, its own and those in code that was copied into it."""
    calls: dict[_Call, None] = {}
    for other in library._linking_libraries:
        known = getattr(other, "adhesis_calls", None)  # numba's own functions have none
        calls.update(dict.fromkeys(_calls_in(other) if known is None else known))
    return list(calls)


class _Kept:
    """What numba's dispatcher asks of a cache, for one function."""

    def __init__(self, function: Callable[..., Any], kind: str = "") -> None:
        self._module, self._function = function.__module__, function.__qualname__
        self._name = f"{self._module}.{self._function}{kind}"

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
        digest, content = content[:_DIGEST], content[_DIGEST:]
        if hashlib.sha256(content).digest() != digest:
            return None  # a damaged file: compiled and written anew
        target.refresh()
        symbols, calls, copied, state = pickle.loads(content)
        # code that this code calls must be there before it, under the name that it calls
        if not all(call.is_ready() for call in calls):
            return None
        target.codegen()._engine._defined_symbols.update(symbols)
        # numba has no types
        result: Any = CompileResult._rebuild(target, *state)  # type: ignore[no-untyped-call]
        self._note(result, signature, calls, copied)
        return result

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep the code of a signature."""
        library = result.library
        if library.has_dynamic_globals:
            raise RuntimeError(f"{self._name} holds an address of this process and cannot be kept")
        calls = _calls_in(library)
        own = library.get_function(result.fndesc.llvm_func_name)
        copied = sum(1 for block in own.blocks for _ in block.instructions) <= _LONGEST_COPIED
        if not copied:
            library._shared_module = binding.parse_assembly("")  # what callers link in
        self._note(result, signature, calls, copied)
        symbols = [
            function.name
            for function in library._final_module.functions
            if not function.is_declaration and function.linkage == binding.Linkage.external
        ]
        state = result._reduce()
        # numba has no types
        content: bytes = dumps((symbols, calls, copied, state))  # type: ignore[no-untyped-call]
        _files().write(self._file(signature), hashlib.sha256(content).digest() + content)

    def _note(self, result: Any, signature: Any, calls: list[_Call], copied: bool) -> None:
        """Leave with the code what those call who call it."""
        if not copied:
            symbol = result.fndesc.llvm_func_name
            calls = [_Call(self._module, self._function, tuple(signature), symbol)]
        result.library.adhesis_calls = calls

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
