"""Step size along a branch: how far the next predictor goes in the prescribed quantity."""

from __future__ import annotations

import math

from adhesis.solver._kernels import STEP_GROWTH, STEP_REDUCTION
from adhesis.solver.sharp.continuation.predictor import Predictor


class StepSize:
    """Limit steps by the predicted motion of edges, by the trapezoidal rule and by failures.

    Parameters
    ----------
    finest : float
        Separation to which a jump is located, in d: the smallest step, but across a fold or to the
        target.

    Attributes
    ----------
    finest : float
    crosses_fold : bool
        Whether the next step is to lead across the fold that the predictor sees.
    """

    def __init__(self, finest: float) -> None:
        self.finest = finest
        self.crosses_fold = False
        self._largest = math.inf
        self._failed = math.inf  # distance of the nearest d at which no equilibrium was found

    def next(self, predictor: Predictor, target: float, motion: float) -> float:
        """Return the next step in d.

        No edge is predicted to move further than ``motion``; neither the target nor a place where
        no equilibrium was found is passed, unless the step leads across a fold.
        """
        size = min(self._largest, predictor.reach(motion, self.finest))
        if 0 < self._failed <= size:
            size = 0.5 * self._failed
        if not predictor.fold_distance < self.finest:
            size = max(size, self.finest)
        if self.crosses_fold:
            size = predictor.across(self.finest)
        left = target - predictor.point.at
        return left if size >= abs(left) else math.copysign(size, left)

    def is_smallest(self, step: float) -> bool:
        """Whether a failure of this step is that of a fold, not of the prediction."""
        return self.crosses_fold or abs(step) <= self.finest

    def reject(self, step: float, predictor: Predictor) -> bool:
        """Note that no equilibrium was found; return whether another step is to be tried."""
        if not self.is_smallest(step):
            self._failed = abs(step)
            self._largest = max(STEP_REDUCTION * abs(step), self.finest)
            return True
        self.crosses_fold = (
            not self.crosses_fold and abs(step) < predictor.fold_distance < 2 * self.finest
        )
        return self.crosses_fold

    def halve(self, step: float) -> None:
        """Take half the step: the curve bends more than the trapezoidal rule allows."""
        self._largest = 0.5 * abs(step)
        # a branch may bend more sharply than jumps are located
        self.finest = min(self.finest, self._largest)

    def accept(self, step: float, ahead: Predictor) -> None:
        """Let the next step be longer; ``ahead`` is the predictor from the point reached."""
        self._largest = STEP_GROWTH * abs(step)
        self.crosses_fold = False
        # only before a fold is a failure more than that of a prediction
        sees_fold = math.isfinite(ahead.fold_distance)
        self._failed = self._failed - abs(step) if sees_fold else math.inf

    def forget_failures(self) -> None:
        """Go on from where a fold turned out to be none."""
        self.crosses_fold, self._failed = False, math.inf

    def refine(self, finest: float) -> None:
        """Locate the fold ahead to ``finest``."""
        self._largest = self.finest = finest
