"""Linear responses of the gaps that are kept from one state to the next."""

from __future__ import annotations

import numpy as np

from adhesis.solver._kernels import LinearResponse, set_up_response, shortest_length
from adhesis.solver.model.profile import Array, Integers
from adhesis.solver.sharp.system.edge_problem import EdgeProblem
from adhesis.solver.sharp.tolerances import RESPONSE_TRIALS, RESPONSES_KEPT


class KeptResponse:
    """A linear response, which changes in place.

    Attributes
    ----------
    response : LinearResponse
    settled : array, optional
        Gaps for which it was last solved.
    is_outgrown : bool
        Whether some gap needs more nodes than it has.
    """

    def __init__(self, response: LinearResponse) -> None:
        self.response = response
        self.settled: Array | None = None
        self.is_outgrown = False


class KeptResponses:
    """The last linear responses of one problem, each with another number of gaps.

    A jump changes the number of gaps, and the end to which equal speeds lead is computed, too.

    Parameters
    ----------
    problem : EdgeProblem
    """

    def __init__(self, problem: EdgeProblem) -> None:
        self._problem = problem
        self._kept: list[KeptResponse] = []  # the last one at the end

    def forget(self) -> None:
        """Forget all, on which results depend within the error of the field."""
        self._kept.clear()

    def near(self, gaps: Array, prescribed: float, least: Integers | None) -> KeptResponse | None:
        """Return a response of as many gaps, not far from these if possible, that is to change.

        ``least`` are the least orders of the gaps, if there are such. None if these have no field.
        """
        if not (np.isfinite(gaps).all() and shortest_length(gaps) > 0):
            return None
        kept, problem = self._kept, self._problem
        known = next((old for old in kept if old.response.gap_count == len(gaps)), None)
        if known is not None:
            kept.remove(known)
        if known is None or known.is_outgrown:
            problem.count.fields += 1
            law, model = problem.law_at(gaps), problem.model
            response = set_up_response(gaps, prescribed, least, law, model)
            if response is None:
                return None
            known = KeptResponse(response)
        kept.append(known)
        del kept[:-RESPONSES_KEPT]
        known.settled = None
        return known

    def at(self, gaps: Array, prescribed: float) -> KeptResponse | None:
        """Return the response about these gaps; None if they have no field."""
        problem = self._problem
        for known in self._kept:
            if known.settled is gaps:
                return known
        for _ in range(RESPONSE_TRIALS):
            near = self.near(gaps, prescribed, None)
            if near is None:
                return None
            if near.response.settle(gaps, prescribed, problem.law_at(gaps), problem.model):
                near.settled = gaps
                return near
            near.is_outgrown = True
        return None
