"""Compile functions with numba and cache the code on disk; the only module that imports numba.

numba's own cache depends on the file of a function, but not on the files of the functions that it
calls, nor on the compiler's settings: after a change, callers would silently keep old code. It also
requires write access where it reads. ``disk_cache`` therefore keeps the code, in a folder named
after the sources of all modules with compiled functions, the versions of numba and LLVM, the
settings that change code, and the processor. Without a usable folder each process compiles anew.

numba links the code of a function into all its callers and optimises it there once more. Here only
short functions are linked; long ones are called by their symbol's name (:class:`_FunctionCache`).

No Python code runs between a call from Python and its result: a signal handler could raise in it,
where neither numba nor LLVM expects an exception, which would become another one, be lost, or end
the process. Hence results are boxed by C code alone (:func:`_box_array`), and functions are loaded
and compiled in a separate thread (``uninterrupted``).
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
from numba.core import boxing, event, ir, lowering, pythonapi, types
from numba.core import config as _config
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.serialize import dumps
from numba.core.typed_passes import NativeLowering
from numba.extending import overload
from numba.np import arrayobj

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


def _shapes_differ(source: Any, target: Any) -> None:
    """Refuse to assign a slice of another shape; only a name, overloaded in compiled code."""
    raise NotImplementedError


@overload(_shapes_differ)
def _shapes_differ_compiled(source: Any, target: Any) -> Any:
    def refuse(source: Any, target: Any) -> None:
        raise ValueError("cannot assign a slice from an array of another shape")

    return refuse


# numba's own message contains the shapes, which takes compiling half of Python's strings: 3.5 s.
if hasattr(arrayobj, "raise_with_shape_context"):
    arrayobj.raise_with_shape_context = _shapes_differ


# ------------------------------------------------------------------- results handed to Python


def _constant(c: Any, value: Any) -> Any:
    """Read ``value``, stored with the compiled function; returns a borrowed reference."""
    return c.env_manager.read_const(c.env_manager.add_const(value))


def _box_array(typ: Any, val: Any, c: Any) -> Any:
    """Box an array as numba does, but with its class as a constant.

    numba itself unpickles the class at each call, by a function in Python.
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

    numba itself calls the class, which runs Python code.
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


# ------------------------------------------------------------------- references to arrays

_NumbaLower: Any = lowering.Lower  # numba has no types
# expressions whose result is kept by their operands; of calls, those of array.reshape
_VIEWS = {"getattr", "static_getitem", "cast", "build_tuple", "exhaust_iter", "undef"}


class _Lower(_NumbaLower):  # type: ignore[misc]
    """numba's code of a function, without counting references to the arrays of its callers.

    A variable *borrows* its arrays if it only ever is an argument or a view of one: callers keep
    these. Counting took up to a fifth of the time of a loop.
    """

    context: Any

    def init(self) -> None:
        """Find the variables that borrow."""
        super().init()
        blocks = self.func_ir.blocks.values()
        assignments = [assign for block in blocks for assign in block.find_insts(ir.Assign)]
        # a result is the caller's own
        owning = {end.value.name for block in blocks for end in block.find_insts(ir.Return)}
        before = -1
        while len(owning) != before:
            before = len(owning)
            for assign in assignments:
                if not self._borrows(assign.value, owning):
                    owning.add(assign.target.name)
        self._borrowing = {assign.target.name for assign in assignments} - owning
        self._uncounted = self.context.subtarget(enable_nrt=False)

    def _borrows(self, value: Any, owning: set[str]) -> bool:
        """Whether a value borrows if the variables that are not ``owning`` do."""
        if isinstance(value, ir.Var):
            return value.name not in owning
        if isinstance(value, ir.Expr):
            return self._is_view(value) and not self._has_own(value, owning)
        return isinstance(value, ir.Arg | ir.Const | ir.Global | ir.FreeVar)

    def _is_view(self, made: Any) -> bool:
        """Whether an array that an expression gives is kept by its operands."""
        if made.op == "call":
            called = self.fndesc.typemap[made.func.name]
            return isinstance(called, types.BoundFunction) and called.key[0] == "array.reshape"
        if made.op == "getitem":
            index = self.fndesc.typemap[made.index.name]
            parts = getattr(index, "types", (index,))  # of a tuple
            return all(isinstance(part, types.Integer | types.SliceType) for part in parts)
        return made.op in _VIEWS

    def _has_own(self, made: Any, owning: set[str]) -> bool:
        """Whether an operand has arrays that are this function's own."""
        models, types_of = self.context.data_model_manager, self.fndesc.typemap
        names = (operand.name for operand in made.list_vars())
        return any(
            name in owning and models[types_of[name]].contains_nrt_meminfo() for name in names
        )

    def lower_inst(self, inst: Any) -> None:
        """Write the code of one instruction."""
        counted, name = self.context, ""
        if isinstance(inst, ir.Assign):
            name = inst.target.name
        elif isinstance(inst, ir.Del):
            name = inst.value
        if name in self._borrowing:
            self.context = self._uncounted
        try:
            super().lower_inst(inst)
        finally:
            self.context = counted


# numba has no types
@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[no-untyped-call]
class _Lowering(NativeLowering):
    """The pass that writes the code of a function."""

    _name = "adhesis_lowering"

    @property
    def lowering_class(self) -> type[_Lower]:
        """Return what writes it."""
        return _Lower


class _Compiler(CompilerBase):
    """numba's compiler, with another last pass."""

    def define_pipelines(self) -> list[Any]:
        """Build the passes."""
        build = DefaultPassBuilder.define_nopython_pipeline
        passes = build(self.state)  # type: ignore[no-untyped-call]  # numba has no types
        replaced = {NativeLowering: _Lowering}
        passes.passes = [(replaced.get(step, step), why) for step, why in passes.passes]
        passes.finalize()
        return [passes]


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
    """Compile ``function`` likewise, with sums taken in any order (vectorised)."""
    return _compile(function, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})


def compiled_finite_sums(function: F) -> F:
    """Compile ``function`` with sums taken in any order, assuming that no number is NaN."""
    return _compile(function, fastmath={"reassoc", "nnan", "nsz", "contract"})


def _compile(function: F, from_python: bool = False, **options: Any) -> F:
    options["pipeline_class"] = _Compiler
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
    """Return what machine code depends on besides its sources and the processor's name."""
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

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Load the code of a signature; None if it is not cached."""
        content = _files().read(self._file(signature))
        if content is None:
            return None
        digest, content = content[:_DIGEST], content[_DIGEST:]
        if hashlib.sha256(content).digest() != digest:
            return None  # a damaged file: compiled and written anew
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
        _files().write(self._file(signature), hashlib.sha256(content).digest() + content)

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
