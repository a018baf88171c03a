"""One wave in contact with a half-space under adhesion of a finite range: Dugdale's law.

Rigid wave h = A cos(q0 x) as in ``single_wave``, of which also the notation is. Surfaces attract
each other with a tension σ0 = γ/δ from a gap δ on. Contact |x| < a, cohesive zone a < |x| < c, at
whose end the gap is δ; the stress is finite at a. In t = sin²(πx/λ) the singular integral equation
of even stresses has the kernel of a half-line, and is solved by elementary integrals. With
y = sin²(πa/λ), tan θ = sqrt((t - y)/(1 - t)), and φ the value of θ at c:

    p̄ = p* y - 2σ0 φ/π
    gap' = gap'_0 + (2σ0/(πE*)) ln |(tan θ + tan φ)/(tan θ - tan φ)|
    s = A (1 - y + y ln y) + (2/λ) ∫_a^{λ/2} (λ/2 - x) (gap' - gap'_0) dx

with gap_0 = 2A [u sqrt(u² - y) - y arcosh(u/sqrt(y))], u = sqrt(t), the gap without adhesion. At
fixed separation surfaces jump together at s = A + δ, and part where s has its maximum on the
branch; between them the loop loses the work of the tension. For δ → 0 all this is Johnson's
solution, in the flat measure.

The branch does not end where the contact vanishes: surfaces may attract each other and not touch,
with a = 0 and a gap of δ - gap(c) at the crest. Where adhesion is weak or its range long that part
of the branch holds the maximum of s (α = 0.3 and δ = 0.2 A, say), or all that is stable of it.

Sources: Dugdale, J. Mech. Phys. Solids 8 (1960) 100; Maugis, J. Colloid Interface Sci. 150 (1992)
243, for a sphere. The integrals above follow from those of a half-line.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import Chebyshev, legendre
from numpy.polynomial.chebyshev import chebpts1
from numpy.typing import ArrayLike
from scipy.optimize import brentq, minimize_scalar

from adhesis.solver.model.profile import Array
from adhesis.solver.references.single_wave import SingleWave

_STATES = 40  # of each part of the branch between the two jumps: a loss to 1e-9
_APART = 1e-9  # of c: half-width that counts as no contact


@cache
def _nodes() -> tuple[Array, Array, Array]:
    """Return distances of nodes in (0, 1) from 0 and from 1, dense at both ends, and weights."""
    nodes, weights = legendre.leggauss(160)
    angle = np.pi / 4 * (nodes + 1)
    first, second = np.sin(angle) ** 2, np.cos(angle) ** 2
    return first, second, np.pi / 4 * np.sin(2 * angle) * weights


def _highest(separation: Callable[[float], float], low: float, high: float) -> float:
    options = {"xatol": 1e-9 * high}
    found = minimize_scalar(
        lambda a: -separation(a), bounds=(low, high), method="bounded", options=options
    )
    return float(found.x)


def _work(state: Callable[[float], tuple[float, float]], low: float, high: float) -> float:
    """Integrate p̄ ds from one state of a branch to another."""
    ends = np.sqrt([low, high])  # what vanishes with the contact is smooth in the root
    root = np.mean(ends) + 0.5 * np.ptp(ends) * chebpts1(_STATES)
    states = np.transpose([state(one**2) for one in root])
    s, p = (Chebyshev.fit(root, values, _STATES - 1, domain=ends) for values in states)
    return float(np.diff((p * s.deriv()).integ()(ends))[0])


@dataclass(frozen=True)
class DugdaleWave:
    """A wave whose surfaces attract each other from a gap δ (``range_``, in m) on."""

    wave: SingleWave
    range_: float

    def zone_end(self, a: float) -> float:
        """Compute c in m, the end of the cohesive zone of the contact |x| < a."""
        low, high = a * (1 + 1e-9), 0.5 * self.wave.period * (1 - 1e-6)
        return float(brentq(lambda c: self._gap(a, c) - self.range_, low, high, xtol=1e-15 * high))

    def state(self, a: float) -> tuple[float, float]:
        """Compute s in m and p̄ in Pa of the equilibrium with the half-width a in m."""
        wave = self.wave
        c, y = self.zone_end(a), float(np.sin(np.pi * a / wave.period) ** 2)
        pulled = self._integral(a, c, 0.5 * wave.period) + self._integral_beyond(a, c)
        separation = wave.amplitude * (1 - y + y * np.log(y)) + 2 / wave.period * pulled
        phi = np.arctan(self._tangent(c, c - a, a))
        tension = 2 * self._strength * float(phi) / np.pi
        return float(separation), wave.full_contact_stress * y - tension

    def state_apart(self, c: float) -> tuple[float, float]:
        """Compute s in m and p̄ in Pa of surfaces that attract over |x| < c and do not touch."""
        pulled = self._integral(_APART * c, c, 0.5 * self.wave.period)
        pulled += self._integral_beyond(_APART * c, c)
        nearest = self.range_ - self._gap(_APART * c, c)
        separation = self.wave.amplitude + nearest + 2 / self.wave.period * pulled
        return separation, -2 * self._strength * c / self.wave.period

    @property
    def loss(self) -> float:
        """Loss of one loop at fixed separation, J/m² of nominal area."""
        wave, touch = self.wave, self.wave.amplitude + self.range_
        far = 0.49 * wave.period
        touching = brentq(lambda c: self._gap(_APART * c, c) - self.range_, 1e-6 * far, far)
        least, most = 1e-6 * wave.fold_half_width, wave.loop.touch_half_width
        branch = [(self.state_apart, 1e-6 * touching, touching), (self.state, least, most)]
        folds = [_highest(lambda a, part=part: part[0](a)[0], *part[1:]) for part in branch]
        if self.state(folds[1])[0] > self.state_apart(folds[0])[0]:
            branch = [(self.state, folds[1], most)]
        else:
            branch[0] = (self.state_apart, folds[0], touching)
        loss = 0.0
        for state, first, last in branch:
            if state(first)[0] <= touch:  # the part before it has come as far
                break
            if state(last)[0] < touch:
                last = brentq(lambda a, state=state: state(a)[0] - touch, first, last)
            loss += _work(state, first, last)
        return loss

    @property
    def _strength(self) -> float:
        return self.wave.work_of_adhesion / self.range_

    def _tangent(self, x: ArrayLike, beyond: ArrayLike, a: float) -> Array:
        """Compute tan θ at x, which lies ``beyond`` the contact by so much."""
        unit = np.pi / self.wave.period
        rise = np.sin(unit * np.asarray(beyond)) * np.sin(unit * (np.asarray(x) + a))  # t - y
        return np.asarray(np.sqrt(rise) / np.cos(unit * np.asarray(x)))

    def _slope(self, x: Array, beyond: Array, from_end: Array, a: float, c: float) -> Array:
        """Compute gap' - gap'_0 at x, whose distances are those from a and from c."""
        unit = np.pi / self.wave.period
        y = np.sin(unit * a) ** 2
        # tan²φ - tan²θ without cancellation
        apart = np.sin(unit * from_end) * np.sin(unit * (c + x)) * (1 - y)
        apart = apart / (np.cos(unit * x) * np.cos(unit * c)) ** 2
        both = (self._tangent(x, beyond, a) + self._tangent(c, c - a, a)) ** 2
        factor = 2 * self._strength / (np.pi * self.wave.modulus)
        return np.asarray(factor * np.log(both / apart))

    def _gap(self, a: float, c: float) -> float:
        """Compute the gap at c in m, where the zone ends there."""
        unit = np.pi / self.wave.period
        y, u = np.sin(unit * a) ** 2, np.sin(unit * c)
        root = np.sqrt(np.sin(unit * (c - a)) * np.sin(unit * (c + a)))
        free = u * root - y * np.arcsinh(root / np.sqrt(y))
        return float(2 * self.wave.amplitude * free + self._integral(a, c))

    def _integral(self, a: float, c: float, to: float | None = None) -> float:
        """Integrate gap' - gap'_0 over the zone, weighted by the distance to ``to`` if given."""
        first, second, weights = _nodes()
        zone = c - a
        x = a + zone * first
        slope = self._slope(x, zone * first, zone * second, a, c)
        return float(zone * (weights @ (slope if to is None else slope * (to - x))))

    def _integral_beyond(self, a: float, c: float) -> float:
        """Integrate (λ/2 - x) (gap' - gap'_0) beyond the zone."""
        first, second, weights = _nodes()
        rest = 0.5 * self.wave.period - c
        x = c + rest * first
        slope = self._slope(x, x - a, rest * first, a, c)
        return float(rest * (weights @ (slope * rest * second)))
