"""Adapt numba's compiler in three respects; only this module and ``jit`` import numba.

Results are boxed by C code alone, the message for slices of different shapes is a short one, and
references are counted only to arrays that a function makes or returns. That holds for functions
with this module's :class:`Compiler`; numba's tables, which a user's own functions are compiled
with, stay as they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import boxing, ir, lowering, pythonapi, types
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering
from numba.extending import overload
from numba.np import arrayobj


def _shapes_differ(source: Any, target: Any) -> None:
    """Refuse to assign a slice of another shape; only a name, overloaded in compiled code."""
    raise NotImplementedError


@overload(_shapes_differ)
def _shapes_differ_compiled(source: Any, target: Any) -> Any:
    def refuse(source: Any, target: Any) -> None:
        raise ValueError("cannot assign a slice from an array of another shape")

    return refuse


@contextmanager
def _short_message() -> Iterator[None]:
    """Write code that refuses a slice of another shape with the short message, inside this context.

    numba's own message contains the shapes, which takes compiling half of Python's strings: 3.5 s.
    Only one thread compiles at a time.
    """
    name = "raise_with_shape_context"
    own = getattr(arrayobj, name, None)
    if own is None:
        yield
        return
    setattr(arrayobj, name, _shapes_differ)
    try:
        yield
    finally:
        setattr(arrayobj, name, own)


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


_BOXERS: dict[Any, Any] = {
    types.Array: _box_array,
    types.NamedTuple: _box_named_tuple,
    types.NamedUniTuple: _box_named_tuple,
}
_NumbaAPI: Any = pythonapi.PythonAPI  # numba has no types


class _PythonAPI(_NumbaAPI):  # type: ignore[misc]  # numba has no types
    """numba's access to Python's objects, with the boxers above."""

    def from_native_value(self, typ: Any, val: Any, env_manager: Any = None) -> Any:
        """Box a value."""
        box = _BOXERS.get(type(typ))
        if box is None:
            return super().from_native_value(typ, val, env_manager)
        return box(typ, val, pythonapi._BoxContext(self.context, self.builder, self, env_manager))


# ------------------------------------------------------------------- references to arrays

_NumbaLower: Any = lowering.Lower  # numba has no types
# expressions whose result is kept by their operands; of calls, those of array.reshape
_INTERNAL: dict[Any, Any] = {}  # functions that numba compiled for code without counting
_VIEWS = {"getattr", "static_getitem", "cast", "build_tuple", "exhaust_iter", "undef"}


class _Lower(_NumbaLower):  # type: ignore[misc]  # numba has no types
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
        # What numba compiles on the way, and keeps for all, must not be code without counting.
        self._uncounted = self.context.subtarget(enable_nrt=False, cached_internal_func=_INTERNAL)

    def _borrows(self, value: Any, owning: set[str]) -> bool:
        """Return whether a value borrows if the variables that are not ``owning`` do."""
        if isinstance(value, ir.Var):
            return value.name not in owning
        if isinstance(value, ir.Expr):
            return self._is_view(value) and not self._has_own(value, owning)
        return isinstance(value, ir.Arg | ir.Const | ir.Global | ir.FreeVar)

    def _is_view(self, made: Any) -> bool:
        """Return whether the result of an expression is kept by its operands."""
        if made.op == "call":
            called = self.fndesc.typemap[made.func.name]
            return isinstance(called, types.BoundFunction) and called.key[0] == "array.reshape"
        if made.op == "getitem":
            index = self.fndesc.typemap[made.index.name]
            parts = getattr(index, "types", (index,))  # of a tuple
            return all(isinstance(part, types.Integer | types.SliceType) for part in parts)
        return made.op in _VIEWS

    def _has_own(self, made: Any, owning: set[str]) -> bool:
        """Return whether an operand has arrays that are this function's own."""
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
            with _short_message():
                super().lower_inst(inst)
        finally:
            self.context = counted

    def create_cpython_wrapper(self, release_gil: bool = False) -> None:
        """Write the code that Python calls."""
        counted, own = self.context, self.context.subtarget()
        own.get_python_api = lambda builder: _PythonAPI(own, builder)
        self.context = own
        try:
            super().create_cpython_wrapper(release_gil)
        finally:
            self.context = counted


# numba has no types
@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[no-untyped-call]
class _Lowering(NativeLowering):
    """The pass that writes the code of a function."""

    _name = "adhesis_lowering"

    @property
    def lowering_class(self) -> type[_Lower]:
        """Return the class that writes it."""
        return _Lower


class Compiler(CompilerBase):
    """numba's compiler, with another last pass."""

    def define_pipelines(self) -> list[Any]:
        """Build the passes."""
        build = DefaultPassBuilder.define_nopython_pipeline
        passes = build(self.state)  # type: ignore[no-untyped-call]  # numba has no types
        replaced = {NativeLowering: _Lowering}
        passes.passes = [(replaced.get(step, step), why) for step, why in passes.passes]
        passes.finalize()
        return [passes]
