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
    version : int
        Changes whenever the response does; no other response has it.
    """

    def __init__(self, response: LinearResponse) -> None:
        self.response = response
        self.settled: Array | None = None
        self.is_outgrown, self.version = False, 0


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
        self._changes = 0

    def forget(self) -> None:
        """Forget all, on which results depend within the error of the field."""
        self._kept.clear()

    def near(self, gaps: Array, prescribed: float, least: Integers | None) -> KeptResponse | None:
        """Return a response of as many gaps, not far from these if possible, that is to change.

        ``least`` are the least orders of the gaps, if there are such. None if these have no field.
        """
        if not (np.isfinite(gaps).all() and shortest_length(gaps) > 0):
            return None
        kept = self._kept
        known = self._of_as_many(gaps)
        if known is not None:
            kept.remove(known)
        else:
            response = self._new(gaps, prescribed, least)
            kept[:] = [old for old in kept if old.response.gap_count != len(gaps)]
            if response is None:
                return None
            known = KeptResponse(response)
        kept.append(known)
        del kept[:-RESPONSES_KEPT]
        known.settled = None
        self._changes += 1
        known.version = self._changes
        return known

    def _of_as_many(self, gaps: Array) -> KeptResponse | None:
        """Return a response of as many gaps, unless the last one has more of these; else None."""
        for known in reversed(self._kept):
            if known.response.gap_count == len(gaps) and not known.is_outgrown:
                last = self._kept[-1]
                if known is last or self._unknown(known, gaps) <= self._unknown(last, gaps):
                    return known
                break
        return None

    def _unknown(self, known: KeptResponse, gaps: Array) -> int:
        """Count the gaps that would be new to a response."""
        problem = self._problem
        return known.response.count_unknown(gaps, problem.law_at(gaps), problem.model)

    def _new(self, gaps: Array, prescribed: float, least: Integers | None) -> LinearResponse | None:
        """Set up a response of these gaps, from the last one if there is one."""
        problem = self._problem
        given = gaps, prescribed, least, problem.law_at(gaps), problem.model
        problem.count.fields += 1
        if self._kept:
            return self._kept[-1].response.update(*given)
        return set_up_response(*given)

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
