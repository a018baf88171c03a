"""The linear response of the gaps that is kept from one state to the next."""

from __future__ import annotations

from adhesis.solver._kernels import LinearResponse, set_up_response, shortest_length
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.system.edge_problem import EdgeProblem


class KeptResponse:
    """The last linear response of one problem, which changes in place.

    Attributes
    ----------
    settled : array, optional
        Gaps for which it was last solved.
    """

    def __init__(self, problem: EdgeProblem) -> None:
        self._problem = problem
        self.forget()

    def forget(self) -> None:
        """Forget it: results depend on it within the error of the field, or it has none."""
        self._response: LinearResponse | None = None
        self.settled: Array | None = None

    def near(self, gaps: Array, prescribed: float) -> LinearResponse | None:
        """Return a response of as many gaps, which is to change; None if these have no field."""
        if not shortest_length(gaps) > 0:
            return None
        problem, self.settled = self._problem, None
        if self._response is None or self._response.gap_count != len(gaps):
            problem.count.fields += 1
            law, model = problem.law_at(gaps), problem.model
            self._response = set_up_response(gaps, prescribed, law, model)
        return self._response

    def at(self, gaps: Array, prescribed: float) -> LinearResponse | None:
        """Return the response about these gaps; None if they have no field."""
        problem = self._problem
        if self.settled is gaps:
            return self._response
        response = self.near(gaps, prescribed)
        if response is None:
            return None
        if not response.settle(gaps, prescribed, problem.law_at(gaps), problem.model):
            self.forget()
            return None
        self.settled = gaps
        return response
