"""Hold a reading of the paper's Table 1 against its values; study/plan.md, *Measure*."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adhesis.ensemble.report.paper import TABLE_1
from study.data import Array

# Draws of the bootstrap in all, and at a time: a probability is known to 1/DRAWS at best.
DRAWS, AT_A_TIME, SEED = 20_000, 1_000, 2016
OFF_DIAGONAL, OF_PAPER = 0.8, 10
LEAST = 1e-3  # eigenvalue of a correlation matrix from cells of different realisations
COMPATIBLE, EXCLUDED = 0.05, 0.001
Cell = tuple[float, float]

# Table 1 with its two largest values exchanged (a hint that was found afterwards).
TRANSPOSED = {**TABLE_1, (0.7, 0.07): TABLE_1[0.8, 0.07], (0.8, 0.07): TABLE_1[0.7, 0.07]}
FACTORS = ("none", "one", "one a row")


def transposed(matrices: Array) -> Array:
    """Exchange the last two axes."""
    return np.swapaxes(matrices, -1, -2)


def sound(covariance: Array) -> Array:
    """Return covariances whose correlations have no eigenvalue below LEAST."""
    spread = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    scale = spread[..., :, None] * spread[..., None, :]
    values, vectors = np.linalg.eigh(covariance / scale)
    found = (vectors * np.maximum(values, LEAST)[..., None, :]) @ transposed(vectors)
    own = np.sqrt(np.diagonal(found, axis1=-2, axis2=-1))
    return np.asarray(found / (own[..., :, None] * own[..., None, :]) * scale)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Losses of some cells held against the paper's; leading axes are independent comparisons.

    Parameters
    ----------
    losses : array, shape (…, cells, realisations)
        NaN where a cell lacks a realisation.
    paper : array, shape (…, cells)
    design : array, shape (cells, factors)
        Which logarithm of a free factor each cell has.
    shared : float
        Share of the covariance between cells that is kept.
    """

    losses: Array
    paper: Array
    design: Array
    shared: float

    @cached_property
    def _there(self) -> NDArray[np.bool_]:
        return np.isfinite(self.losses)

    @cached_property
    def means(self) -> Array:
        """Mean loss of each cell."""
        total = np.where(self._there, self.losses, 0.0).sum(axis=-1)
        return np.asarray(total / self._there.sum(axis=-1))

    @cached_property
    def deviation(self) -> Array:
        """ln(paper/mean) of each cell; infinite where a mean that was drawn is not positive."""
        ratio = self.paper / self.means
        return np.log(ratio, out=np.full_like(ratio, np.inf), where=ratio > 0)

    @cached_property
    def _together(self) -> Array:
        """Numbers of realisations that two cells share."""
        count = self._there.astype(float)
        return np.asarray(count @ transposed(count))

    @cached_property
    def of_profile(self) -> Array:
        """Covariance between cells of the relative loss of a profile.

        Over the realisations that two cells share, about the means of all that each has.
        """
        away: Array = np.nan_to_num(self.losses / self.means[..., None] - 1)
        relative = away @ transposed(away) / np.maximum(self._together - 1, 1)
        own = np.eye(relative.shape[-1], dtype=bool)
        return np.asarray(np.where(own, 1.0, self.shared) * relative)

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the deviation of a right reading: of a mean of ten, and of ours.

        Its correlations are made sound where factors are fitted, which takes its inverse.
        """
        own = np.diagonal(self._together, axis1=-2, axis2=-1)
        means = self._together / (own[..., :, None] * own[..., None, :])
        found = np.asarray(self.of_profile * (1 / OF_PAPER + means))
        return sound(found) if self.design.size else found

    @cached_property
    def fit(self) -> Array:
        """Matrix from deviations to logarithms of the factors, by generalised least squares."""
        solved = np.asarray(np.linalg.solve(self.covariance, self.design), dtype=np.float64)
        weighted = transposed(solved)
        return np.asarray(np.linalg.solve(weighted @ self.design, weighted))

    @cached_property
    def z(self) -> Array:
        """Deviation over its standard deviation, fitted factors taken out."""
        covariance, left = self.covariance, self.deviation
        if self.design.size:
            rest = np.eye(self.design.shape[0]) - self.design @ self.fit
            left = (rest @ left[..., None])[..., 0]
            covariance = rest @ covariance @ transposed(rest)
        return np.asarray(left / np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)))


@dataclass(frozen=True, eq=False)
class Sample:
    """Losses of the same profiles in several cells.

    Attributes
    ----------
    cells : tuple of (H, γ)
        Of the paper's, those that were computed.
    losses : array, shape (cells, realisations)
        W~; NaN where a cell lacks a realisation.
    """

    cells: tuple[Cell, ...]
    losses: Array
    _drawn: dict[tuple[str, float], Array] = field(default_factory=dict, init=False, repr=False)

    def design(self, factors: str) -> Array:
        """Which logarithm of a factor each cell has, shape (cells, factors)."""
        if factors == "one":
            return np.ones((len(self.cells), 1))
        if factors == "one a row":
            hursts = sorted({hurst for hurst, _ in self.cells})
            return np.array([[float(hurst == h) for h in hursts] for hurst, _ in self.cells])
        return np.zeros((len(self.cells), 0))

    def drawn(self, factors: str, shared: float) -> Array:
        """Return |z| of right readings, shape (draws, cells), by a parametric bootstrap.

        Each has a mean of the paper's and as many losses in each cell as there are here, drawn
        from the normal law with the covariance found here; means, covariance, factors and z are
        found from them as from the real ones. So z has the wide tails that it has with few loops.
        A draw without a z, of a mean that is not positive, counts as infinitely far.
        """
        if (factors, shared) not in self._drawn:
            self._drawn[factors, shared] = self._draw(factors, shared)
        return self._drawn[factors, shared]

    def _draw(self, factors: str, shared: float) -> Array:
        design, there = self.design(factors), np.isfinite(self.losses)
        here = Comparison(self.losses, np.ones(len(self.cells)), design, shared)
        factor = np.linalg.cholesky(sound(here.of_profile))
        rng = np.random.default_rng(SEED)
        found = []
        for _ in range(DRAWS // AT_A_TIME):
            ours = 1 + factor @ rng.standard_normal((AT_A_TIME, *self.losses.shape))
            theirs = rng.standard_normal((AT_A_TIME, len(self.cells), 1)) / np.sqrt(OF_PAPER)
            paper = 1 + (factor @ theirs)[..., 0]
            with np.errstate(invalid="ignore", over="ignore"):  # infinite deviations
                z = Comparison(np.where(there, ours, np.nan), paper, design, shared).z
                found.append(np.nan_to_num(np.abs(z), nan=np.inf).astype(np.float32))
        return np.concatenate(found)


@dataclass(frozen=True, eq=False)
class Reading:
    """One reading, compared with the paper.

    Attributes
    ----------
    name : str
    sample : Sample
    paper : dict
        Loss of each (H, γ).
    factors : str
        Free factors of the unit of the loss, one of FACTORS.
    shared : float
        Share of the covariance between cells that is kept: the paper may have used one set of
        profiles for all cells, or another set for each (0).
    """

    name: str
    sample: Sample
    paper: dict[Cell, float] = field(default_factory=lambda: TABLE_1)
    factors: str = "none"
    shared: float = OFF_DIAGONAL

    @property
    def cells(self) -> tuple[Cell, ...]:
        """Cells of the paper's table that were computed."""
        return self.sample.cells

    @property
    def realisations(self) -> int:
        """Number of profiles of the cell that has fewest."""
        return int(np.isfinite(self.sample.losses).sum(axis=1).min())

    @cached_property
    def _found(self) -> Comparison:
        paper = np.array([self.paper[cell] for cell in self.cells])
        design = self.sample.design(self.factors)
        return Comparison(self.sample.losses, paper, design, self.shared)

    @property
    def means(self) -> Array:
        """Mean W~ of each cell."""
        return self._found.means

    @property
    def z(self) -> Array:
        """ln(paper/mean) over its standard deviation, fitted factors taken out."""
        return self._found.z

    @cached_property
    def fitted(self) -> Array:
        """Factors of the computed losses, in the order of their H."""
        return np.asarray(np.exp(self._found.fit @ self._found.deviation))

    @cached_property
    def p(self) -> float:
        """Probability that a right reading has a largest |z| as large."""
        return self.over(self.cells)[1]

    def over(self, cells: Iterable[Cell]) -> tuple[float, float]:
        """Return the largest |z| of some cells, and its p."""
        some = [self.cells.index(cell) for cell in cells]
        largest = float(np.abs(self.z[some]).max())
        drawn = self.sample.drawn(self.factors, self.shared)[:, some]
        return largest, float(np.mean(drawn.max(axis=1) >= np.float32(largest)))

    @property
    def largest(self) -> float:
        """Largest |z|."""
        return float(np.abs(self.z).max())

    @property
    def worst(self) -> Cell:
        """Cell of the largest |z|."""
        return self.cells[int(np.argmax(np.abs(self.z)))]

    @property
    def verdict(self) -> str:
        """compatible, doubtful or excluded."""
        return verdict_of(self.p)


def verdict_of(p: float) -> str:
    """Verdict on a probability."""
    if p >= COMPATIBLE:
        return "compatible"
    return "excluded" if p < EXCLUDED else "doubtful"


def error_of(p: float) -> float:
    """Standard error of a probability, for the number of draws."""
    return float(np.sqrt(p * (1 - p) / DRAWS))
