"""A window of few gaps on an equilibrium of many, as Python uses it."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.griffith import step_limits
from adhesis.solver.sharp.equilibrium.linear_exterior import extend_window, open_window
from adhesis.solver.sharp.equilibrium.linear_response import LinearResponse
from adhesis.solver.sharp.field.exterior import Exterior
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import Integers


class Window:
    """A window on a solved state: its gaps, the others as one gap more, the last one.

    Parameters
    ----------
    gaps : array, shape (L, 2)
        All gaps of the state.
    response : LinearResponse
        About the state; it must not change.
    first, width : int
        First gap of the window, and how many.
    following : float
        Edges outside that are out of balance by a longer motion are held; 0 holds all.
    law : EdgeLaw
    model : FieldModel

    Attributes
    ----------
    gaps : array, shape (width + 1, 2)
        Angles rise beyond the period where the window goes on at its beginning.
    inside : int array, shape (width,)
        Its gaps among all.
    orders : int array, shape (width + 1,)
    exterior : Exterior
        Response of the others.
    exterior_is_stable : bool
        Whether the others are stable by themselves.
    """

    def __init__(
        self,
        gaps: Array,
        response: LinearResponse,
        first: int,
        width: int,
        following: float,
        law: EdgeLaw,
        model: FieldModel,
    ) -> None:
        self._all, self._response, self._law, self._model = gaps, response, law, model
        self.gaps: Array
        self.exterior: Exterior
        self.gaps, self.exterior, self._outside = open_window(
            response, gaps, first, width, following, law, model
        )
        self.inside: Integers = (first + np.arange(width)) % len(gaps)
        self.orders: Integers = np.append(response.nodes.orders[self.inside], 0)
        self.exterior_is_stable = bool(self._outside.factor.negative[-1] == 0)
        # beyond the middle of the patch in which the period ends
        self._end = 0.5 * (gaps[-1, 1] + gaps[0, 0] + 2 * np.pi)

    def restrict(self, gaps: Array) -> Array:
        """Restrict other gaps of all to those inside the window, the exterior being the last."""
        left, right = self.gaps[0, 0], self.gaps[-2, 1]
        both = np.concatenate([gaps, gaps + 2 * np.pi])
        inside = both[(both[:, 0] >= left) & (both[:, 1] <= right)]
        return np.concatenate([inside, self.gaps[-1:]])

    def extend(self, local: Array, orders: Integers, prescribed: float) -> tuple[Array, float]:
        """Extend gaps of the window to all gaps, the others following by at most a longest step.

        Also returns how far the furthest would follow; NaN where the window has no field.
        """
        motion = extend_window(
            local, prescribed, orders, self.exterior, self._outside, self._response,
            np.full(self._all.size, np.inf), self._model,
        )  # fmt: skip
        limit = step_limits(map_gaps(self._all), self._law.longest_step)
        outside = self._all + np.clip(motion, -limit, limit).reshape(-1, 2) * [1.0, -1.0]
        inside = local[:-1].copy()
        inside[inside.mean(axis=1) > self._end] -= 2 * np.pi
        gaps = np.concatenate([inside, outside[self._outside.gaps]])
        gaps = gaps[np.argsort(gaps[:, 0], kind="stable")]
        return np.asarray(gaps), float(np.abs(motion).max())
