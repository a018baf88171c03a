"""Linear responses of any number of gaps that are kept from one state to the next."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, Integers, choose_orders
from adhesis.solver.sharp.one_tree.tree_renewal import settle_response
from adhesis.solver.sharp.one_tree.tree_response import TreeResponse
from adhesis.solver.sharp.one_tree.tree_setup import (
    count_unknown,
    set_up_response,
    update_response,
)
from adhesis.solver.sharp.system.kept_responses import KeptResponse, KeptResponses
from adhesis.solver.sharp.tolerances import RESPONSE_TRIALS

_ANY = np.empty(0, dtype=np.int64)


class KeptTrees(KeptResponses):
    """The last linear responses of one problem, as ``KeptResponses`` keeps them."""

    def _unknown(self, known: KeptResponse, gaps: Array) -> int:
        """Count the gaps that would be new to a response."""
        problem = self._problem
        return int(count_unknown(known.response, gaps, problem.law, problem.model))

    def _new(self, gaps: Array, prescribed: float, least: Integers) -> TreeResponse | None:
        """Set up a response of these gaps, from the last one if there is one."""
        problem = self._problem
        law, model = problem.law, problem.model
        problem.count.fields += 1
        if self._kept:
            last = self._kept[-1].response
            response, has_field = update_response(last, gaps, prescribed, least, law, model)
        else:
            orders = choose_orders(map_gaps(gaps), model.digits, GAUSS_RULES.counts)
            if len(least) == len(orders):
                orders = np.maximum(orders, least)
            response, has_field = set_up_response(gaps, prescribed, orders, law, model)
        return response if has_field else None

    def at(self, gaps: Array, prescribed: float) -> KeptResponse | None:
        """Return the response about these gaps; None if they have no field."""
        problem = self._problem
        for known in self._kept:
            if known.settled is gaps:
                return known
        for _ in range(RESPONSE_TRIALS):
            near = self.near(gaps, prescribed, _ANY)
            if near is None:
                return None
            if settle_response(near.response, gaps, prescribed, problem.law, problem.model):
                near.settled = gaps
                return near
            near.is_outgrown = True
        return None
