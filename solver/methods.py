"""The methods by name."""

from __future__ import annotations

from typing import Any, Literal, get_args

from solver.method import Method
from solver.problem import Problem

MethodName = Literal["grid", "sharp", "auto"]
METHOD_NAMES: tuple[MethodName, ...] = get_args(MethodName)


def make_method(
    name: MethodName,
    problem: Problem,
    *,
    accuracy: float = 1e-3,
    nodes_per_wave: int | None = None,
) -> Method:
    """Build the method ``name`` for a problem.

    Parameters
    ----------
    name : {"grid", "sharp", "auto"}
    problem : Problem
    accuracy : float
        Wanted relative error of the loss, 0 < accuracy < 1.
    nodes_per_wave : int, optional
        For ``grid``: nodes per shortest wave, instead of those that ``accuracy`` asks for.

    Raises
    ------
    ValueError
        For an unknown name or a value outside its range.
    """
    if name not in METHOD_NAMES:
        raise ValueError(f"method is {name!r}: it must be one of {', '.join(METHOD_NAMES)}")
    if not 0 < accuracy < 1:
        raise ValueError(f"accuracy is {accuracy!r}: it must lie between 0 and 1, both excluded")
    options: dict[str, Any] = {"accuracy": accuracy}
    if name == "grid":
        from solver.grid import GridMethod

        return GridMethod(problem, nodes_per_wave=nodes_per_wave, **options)
    from solver.sharp import SharpMethod

    if nodes_per_wave is not None:
        raise ValueError(
            f"nodes_per_wave is {nodes_per_wave!r}: it belongs to the method 'grid' alone"
        )
    return SharpMethod(problem, **options)
