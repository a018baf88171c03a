"""Losses under adhesion of a finite range beside those of ``sharp``.

    python benchmarks/finite_range.py even [--loops 40] [--seed 1]
    python benchmarks/finite_range.py random [--loops 40] [--seed 1] [--edges 0.5 [--opening]]

The range is half of the least of ``valid_range``, ``edge_range``, ``touch_range`` and
``turn_range`` of a loop of zero range, or with ``--edges`` a share of ``edge_range``. The loss is
compared with that of zero range, and with that of a loop at this range; the latter must be less
than a tenth off. Exit code 1 if one is not.

**even**: random even profiles whose loops have one even patch throughout, under Dugdale's law, in
closed form. The profile is h = Σ A_n cos(nθ), θ = 2πx/λ, in contact for |θ| < a, cohesive for
a < |θ| < c, where the gap grows from 0 to δ. With y = sin²(a/2), u = sin(θ/2), and P_n Legendre's
polynomials:

    S(y)   = Σ (n E* q0 A_n / 4) [P_{n-1}(1 - 2y) - P_n(1 - 2y)]
    p̄      = S(y) - 2 σ0 φ / π,        tan²φ = (sin²(c/2) - y) / (1 - sin²(c/2))
    dg/dx  = -h' - (2/E*) cos(θ/2) ∫_0^y S'(z) / sqrt(u² - z) dz
             + (2 σ0 / (π E*)) ln |(tan ψ + tan φ) / (tan ψ - tan φ)|,   ψ like φ at θ

by superposing flat punches, as Johnson, Int. J. Solids Struct. 32 (1995) 423, for one wave; the
last term is that of ``tests.support.dugdale_wave``. The separation is the mean gap.

**random**: any random profile, by minimising the energy of the gap g ≥ 0 on a uniform periodic
grid at a fixed mean gap, from each state to the next in small steps:

    U/λ = (E*/4) Σ |q| |g_q + h_q|² + mean φ(g),    φ'(g) = σ0 up to δ/2, 0 from 3δ/2 on,

falling like a cosine in between, with σ0 = γ/δ. Its work is γ and its mean range δ, as Dugdale's.
Dugdale's own law, cut off at δ, pins the ends of zones between nodes. This one does not from three
nodes in a zone on: at δ = 0.03 of its amplitude the loss of one wave is then within a hundredth of
the exact one. Loops whose zones would take more than ``--most-nodes`` are drawn again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pyfftw
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre, leggauss
from scipy.fft import irfft, next_fast_len
from scipy.optimize import brentq

from adhesis import HalfSpace, Problem, Profile, make_method, run_loop
from adhesis.solver.method import PathError
from adhesis.solver.sharp.tolerances import LONGEST_GRIFFITH_CRACK

STATES = 800
NODES, WEIGHTS = leggauss(40)
SHARE = 0.5  # of the least range
ROUNDING = 0.5  # of the range: half of the width over which the attraction falls to zero
NODES_OF_ZONE = 4.0


class OnePatch:
    """An even profile with one patch around x = 0; lengths in 1/q0, E* = 1."""

    def __init__(self, amplitudes: Sequence[float], work_of_adhesion: float) -> None:
        self.amplitudes, self.gamma = np.asarray(amplitudes, float), work_of_adhesion
        self.n = np.arange(1, len(self.amplitudes) + 1)
        y = Polynomial([0, 1])
        legendre = [
            Legendre.basis(n).convert(kind=Polynomial)(1 - 2 * y)
            for n in range(len(amplitudes) + 1)
        ]
        self.pressed = sum(
            n * a / 4 * (legendre[n - 1] - legendre[n]) for n, a in enumerate(amplitudes, 1)
        )

    def free_slope(self, x, beyond):
        """Slope of the gap at x without adhesion, ``beyond`` the edge of contact."""
        u, low = np.sin(x / 2), np.sqrt(_rise(x, beyond))
        w = 0.5 * (u + low)[..., None] + 0.5 * (u - low)[..., None] * NODES
        inner = 2 * self.pressed.deriv()(u[..., None] ** 2 - w**2) @ WEIGHTS
        slope = np.sin(np.multiply.outer(x, self.n)) @ (self.n * self.amplitudes)
        return slope - np.cos(x / 2) * (u - low) * inner

    def finite_range(self, a, delta):
        """Separation and mean stress at a half-width a; NaN if the zone would fill the gap."""
        sigma = self.gamma / delta

        def beyond(log_zone):
            _, weights, slope = self._piece(a, np.exp(log_zone), sigma, in_zone=True)
            return weights @ slope - delta

        low, high = np.log(1e-9 * (np.pi - a)), np.log((1 - 1e-9) * (np.pi - a))
        if beyond(low) > 0 or beyond(high) < 0:
            return np.nan, np.nan
        zone = np.exp(brentq(beyond, low, high, xtol=1e-11))
        separation = sum(
            _mean(x, weights, slope)
            for x, weights, slope in (
                self._piece(a, zone, sigma, in_zone=True),
                self._piece(a, zone, sigma, in_zone=False),
            )
        )
        phi = np.arctan(np.sqrt(_rise(a + zone, zone)) / np.cos((a + zone) / 2))
        pressed = float(self.pressed(np.sin(a / 2) ** 2))
        return separation, pressed - 2 * sigma * float(phi) / np.pi

    def _piece(self, a, zone, sigma, in_zone):
        """Nodes, weights, and slope of the gap there, in the zone or beyond it."""
        c = a + zone
        near, far, weights = _graded(zone if in_zone else np.pi - c)
        from_a, from_c = (near, far) if in_zone else (zone + near, near)
        x = a + from_a
        t = np.sqrt(_rise(x, from_a)) / np.cos(x / 2)
        end = np.sqrt(_rise(c, zone)) / np.cos(c / 2)
        # |tan²φ - tan²ψ| without cancellation
        apart = np.sin(from_c / 2) * np.sin((c + x) / 2) * np.cos(a / 2) ** 2
        apart = apart / (np.cos(x / 2) * np.cos(c / 2)) ** 2
        slope = self.free_slope(x, from_a) + 2 * sigma / np.pi * np.log((t + end) ** 2 / apart)
        return x, weights, slope

    def loss(self, deepest, delta, states):
        """Loss of one loop at fixed separation down to a penetration, per area."""
        top = float(self.amplitudes.sum())
        touch, turn = top + delta, top - deepest
        widths = np.pi * np.sin(np.linspace(0.02, 0.97, states) * np.pi / 2) ** 2
        found = np.array([self.finite_range(a, delta) for a in widths])
        s, p = found[np.isfinite(found[:, 0])].T  # next to full contact there is no such zone
        return hysteresis(s, p, touch, turn)


def _rise(x, beyond):
    """Compute sin²(x/2) - sin²(a/2), with x = a + beyond, without cancellation."""
    return np.sin(beyond / 2) * np.sin(x - beyond / 2)


def _graded(length):
    """Distances of nodes from both ends of a piece, dense at both, and weights."""
    angle = np.pi / 4 * (NODES + 1)
    weights = length * np.pi / 4 * np.sin(2 * angle) * WEIGHTS
    return length * np.sin(angle) ** 2, length * np.cos(angle) ** 2, weights


def _mean(x, weights, slope):
    """Mean gap of an even gap with this slope: ∫ gap dx = ∫ (π - x) slope dx over half a period."""
    return float(weights @ ((np.pi - x) * slope)) / np.pi


def hysteresis(s, p, touch, turn):
    """Follow a branch (s, p̄ by growing contact) from touch to turn and back until none is left."""
    fine = 20000
    loss = 0.0
    # loading: the contact grows until the separation of its equilibrium is no larger than s
    grid = np.linspace(touch, turn, fine)
    reached = np.minimum.accumulate(s)
    begin = int(np.argmax(s))
    reached[:begin] = np.inf
    place = np.searchsorted(-reached, -grid)  # first state with s <= grid
    up = _stress(s, p, place, grid)
    loss += np.trapezoid(up, -grid)
    # unloading: it shrinks until the separation of its equilibrium is no smaller than s
    last = place[-1]
    held = np.maximum.accumulate(s[: last + 1][::-1])[::-1]
    grid = np.linspace(turn, held[0], fine)
    place = np.searchsorted(-held, -grid, side="right") - 1
    place = np.clip(place, 0, last)
    down = _stress(s, p, place + 1, grid)
    return loss + np.trapezoid(down, -grid)


def _stress(s, p, place, grid):
    """Interpolate between the state before a place and that at it, at given separations."""
    place = np.clip(place, 1, len(s) - 1)
    before, at = s[place - 1], s[place]
    share = np.clip((grid - before) / np.where(at == before, 1.0, at - before), 0, 1)
    return p[place - 1] + share * (p[place] - p[place - 1])


def _sum(values):
    """Sum without linear algebra, whose threads cost far more than they save here."""
    return float(np.add.reduce(values))


def _mean_of(values, free):
    """Mean over the free nodes."""
    return _sum(values * free) / _sum(free)


class GridLoop:
    """A loop of any profile on a uniform periodic grid; lengths in 1/q0, E* = 1.

    Parameters
    ----------
    height : array
        Of the rigid profile at the nodes.
    gamma, delta : float
        Work of adhesion and range.
    """

    def __init__(self, height, gamma, delta, tolerance=3e-3):
        self.height, self.delta = np.asarray(height, float), delta
        self.nodes = len(self.height)
        self.strength, self.reach = gamma / delta, (1 + ROUNDING) * delta
        self.tolerance = tolerance * self.strength
        self.symbol = np.arange(self.nodes // 2 + 1) / 2
        self.response = 1 / np.maximum(self.symbol, 0.5)
        nodal, waves = np.zeros(self.nodes), np.zeros(self.nodes // 2 + 1, complex)
        self.to_waves = pyfftw.builders.rfft(nodal, threads=1)
        self.to_nodes = pyfftw.builders.irfft(waves, n=self.nodes, threads=1)
        self.steps = 0

    def attraction(self, gap):
        """Tension between surfaces at a gap: Dugdale's with a rounded end."""
        share = np.clip((gap / self.delta - 1 + ROUNDING) / (2 * ROUNDING), 0, 1)
        return self.strength * (0.5 + 0.5 * np.cos(np.pi * share))

    def relax(self, gap, separation):
        """Descend from a gap to the minimum with this mean gap; also returns the mean stress.

        Conjugate gradients (Polak-Ribiere), preconditioned by 1/|q| on the free nodes. No step
        moves a node by more than two ranges, so that a front does not leap over a minimum.
        """
        gap = gap * (separation / gap.mean())
        before = np.inf
        direction = last = np.zeros(self.nodes)
        while True:
            self.steps += 1
            force = self._filter(self.symbol, gap + self.height)
            near = np.flatnonzero(gap < self.reach)
            force[near] += self.attraction(gap[near])
            free = (gap > 0).astype(float)
            free[force < _mean_of(force, free)] = 1.0  # contact that is pulled off
            mean = _mean_of(force, free)
            force = (force - mean) * free
            if np.abs(force).max() < self.tolerance:
                return gap, -mean
            fall = self._filter(self.response, force)
            fall = (fall - _mean_of(fall, free)) * free
            direction = direction * free * max(0.0, _sum((force - last) * fall) / before)
            direction -= _mean_of(direction, free) * free
            if _sum((direction - fall) * force) >= 0:
                direction[:] = 0
            direction -= fall
            before, last = _sum(force * fall), force
            length = self._length(gap, direction, _sum(force * direction))
            gap = np.maximum(gap + length * direction, 0)
            gap *= separation / gap.mean()

    def _filter(self, symbol, values):
        """Multiply the waves of nodal values by a symbol."""
        return self.to_nodes(symbol * self.to_waves(values)).copy()

    def _length(self, gap, direction, slope):
        """Find where the energy stops falling along a direction, or the longest step."""
        waves = self.symbol * np.abs(self.to_waves(direction)) ** 2
        curvature = (2 * waves.sum() - waves[-1]) / self.nodes
        longest = 2 * self.delta / np.abs(direction).max()
        near = np.flatnonzero((gap < self.reach + 2 * self.delta) & (direction != 0))
        start, way = gap[near], direction[near]
        slope -= _sum(self.attraction(start) * way)

        def rise(length):
            pulled = _sum(self.attraction(np.maximum(start + length * way, 0)) * way)
            return slope + length * curvature + pulled

        low, high = 0.0, min(1.0, longest)
        at_low, at_high = rise(0.0), rise(high)
        while at_high < 0 and high < longest:
            low, at_low = high, at_high
            high = min(2 * high, longest)
            at_high = rise(high)
        if at_high <= 0:
            return high
        for _ in range(3):
            length = low + (high - low) * np.clip(at_low / (at_low - at_high), 0.05, 0.95)
            at = rise(length)
            if at > 0:
                high, at_high = length, at
            else:
                low, at_low = length, at
        return length

    def loss(self, turn, step, share):
        """Loss from out of reach to a separation and back until out of reach, per area.

        A step that changes p̄ by more than ``share`` over its length, beyond the trend, is quartered
        down to a 64th of ``step``: it holds a jump, which the trapezoidal rule puts in its middle.
        """
        s, p = [self.height.max() + self.reach], [0.0]
        gap = earlier = s[0] - self.height
        way, ds, smooth, rate, loss = -1, step, False, 0.0, 0.0
        while way < 0 or gap.min() < self.reach:
            to = max(s[-1] + way * ds, turn)
            start = gap
            if smooth:
                trend = (gap - earlier) * (to - s[-1]) / (s[-1] - s[-2])
                start = np.where(gap > 0, np.maximum(gap + trend, 0), 0)
            found, mean = self.relax(start, to)
            off = abs(mean - p[-1] - rate * (to - s[-1])) * ds
            if off > share and ds > step / 64:
                ds = max(ds / 4, step / 64)
                continue
            smooth, rate = off < 0.3 * share, (mean - p[-1]) / (to - s[-1])
            loss -= 0.5 * (mean + p[-1]) * (to - s[-1])
            earlier, gap = gap, found
            s.append(to)
            p.append(mean)
            ds = min(step, 1.5 * ds)
            if way < 0 and to <= turn:
                way, ds, smooth = 1, step, False
        return loss


PERIOD, HEIGHT, MODULUS = 1e-3, 1e-6, 1e6  # m, m, Pa: slopes so small that the measure is flat
Q0 = 2 * np.pi / PERIOD


def draw_even(rng, _):
    """Draw an even profile with its crest at 0, γ, and a penetration."""
    while True:
        waves = int(rng.integers(1, 13))
        n = np.arange(1, waves + 1)
        amplitudes = rng.normal(size=waves) * n**-1.5 * rng.uniform(0.05, 0.4)
        amplitudes[0] = 1.0
        alpha, depth = rng.uniform(0.1, 0.5), rng.uniform(0.3, 0.8)
        height = np.cos(np.outer(np.linspace(0, np.pi, 4001), n)) @ amplitudes
        if np.argmax(height) == 0:
            break
    gamma = 0.5 * (alpha * np.pi * HEIGHT / PERIOD) ** 2 * MODULUS * PERIOD
    return np.append(0, 0.5 * HEIGHT * amplitudes).astype(complex), gamma, depth


def draw_random(rng, lowest_most):
    """Draw a profile of 4 to 40 waves with random phases, γ, and a penetration."""
    lowest = int(rng.integers(1, lowest_most + 1))
    n = np.arange(lowest, lowest + int(np.round(3 * 12 ** rng.uniform())) + 1)
    coefficients = np.zeros(n[-1] + 1, complex)
    coefficients[n] = n ** -(rng.uniform(0.2, 0.9) + 0.5) * rng.rayleigh(size=n.size)
    coefficients[n] *= np.exp(2j * np.pi * rng.uniform(size=n.size))
    coefficients *= HEIGHT / np.sqrt(2 * np.sum(np.abs(coefficients) ** 2))
    gamma = 10 ** rng.uniform(-2.5, 0.3) * MODULUS * HEIGHT**2 * Q0 * lowest
    return coefficients, float(gamma), float(rng.uniform(0.4, 0.97))


def loss_of_even(loop, coefficients, gamma, delta, args):
    """Loss in J/m² by the closed form; None if the loop has other patches than one even one."""
    kinds = sorted(jump.kind for jump in loop.jumps if not jump.small_scale)
    raced = any(jump.raced for jump in loop.jumps)  # one edge runs ahead: no longer even
    if kinds != ["pull-off", "snap-in"] or raced or loop.largest_contact_fraction > 0.9:
        return None
    scene = OnePatch(2 * Q0 * coefficients[1:].real, gamma * Q0 / MODULUS)
    return scene.loss(
        loop.max_penetration * loop.problem.profile.h_max * Q0, delta * Q0, int(args.fine * STATES)
    )


def loss_of_random(loop, coefficients, gamma, delta, args):
    """Loss in J/m² on a grid; None if zones are too short for it."""
    zone = np.pi / 4 * MODULUS * delta**2 / gamma
    nodes = next_fast_len(int(np.ceil(NODES_OF_ZONE * PERIOD / zone)), real=True)
    if nodes > args.most_nodes or max(loop.patches) < args.patches:
        return None
    nodes = next_fast_len(int(args.fine * max(nodes, 32 * len(coefficients))), real=True)
    height = nodes * irfft(Q0 * coefficients, nodes)
    grid = GridLoop(height, gamma * Q0 / MODULUS, delta * Q0)
    turn = Q0 * loop.problem.separation(loop.max_penetration)
    step, share = 2 * delta / args.fine, 0.01 * loop.loss / args.fine
    return grid.loss(turn, step * Q0, share * Q0 / MODULUS)


def main() -> int:
    """Draw, compare, print; returns 1 if a loss is more than a tenth off."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("profiles", choices=["even", "random"])
    parser.add_argument("--loops", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first draw")
    parser.add_argument("--fine", type=float, default=1.0, help="nodes and steps, in those usual")
    parser.add_argument("--lowest", type=int, default=3, help="largest lowest wave number drawn")
    parser.add_argument("--patches", type=int, default=1, help="at least, of a loop that is judged")
    parser.add_argument("--edges", type=float, help="range over edge_range, not half the least")
    parser.add_argument("--opening", action="store_true", help="loops whose patches open alone")
    parser.add_argument("--most-nodes", type=int, default=1 << 13, help="of a loop that is judged")
    args = parser.parse_args()
    is_even = args.profiles == "even"
    draw, judge = (draw_even, loss_of_even) if is_even else (draw_random, loss_of_random)
    accuracy, one_after_another = 1e-4 if is_even else 1e-3, np.random.default_rng(args.seed)
    found, number = 0, args.first
    worst = 0.0
    print("number  waves  patches  jumps  contact  ", end="")
    print("valid  edge  touch  turn  range (nm)  loss (J/m²)  off by  at zero range  doubts")
    while found < args.loops:
        own = np.random.default_rng([args.seed, number])
        coefficients, gamma, depth = draw(one_after_another if is_even else own, args.lowest)
        number += 1
        problem = Problem(Profile(PERIOD, coefficients), HalfSpace(MODULUS, 0.0), gamma)
        try:
            loop = run_loop(make_method("sharp", problem, accuracy=accuracy), max_penetration=depth)
        except PathError:
            continue
        ranges = [loop.valid_range, *loop.outer_ranges]
        delta = SHARE * min(ranges)
        if args.edges is not None:  # longer ones are refused
            crack = LONGEST_GRIFFITH_CRACK * problem.shortest_wavelength * (1 - 1e-9)
            longest = np.sqrt(np.pi * gamma * crack / (4 * MODULUS))
            delta = min(args.edges * loop.edge_range, longest)
        if args.opening and delta < loop.valid_range:
            continue
        loss = judge(loop, coefficients, gamma, delta, args)
        if loss is None:
            continue
        finite = replace(problem, adhesion_range=delta)
        ranged = run_loop(make_method("sharp", finite, accuracy=accuracy), max_penetration=depth)
        loss *= MODULUS / Q0
        zero, off = loss / loop.loss - 1, (loss - ranged.loss) / max(loss, ranged.loss)
        print(
            f"{number - 1:6} {len(coefficients) - 1:6} {max(loop.patches):8} {len(loop.jumps):6} "
            f"{loop.largest_contact_fraction:8.2f} "
            + " ".join(f"{1e9 * one:6.4g}" for one in ranges)
            + f" {1e9 * delta:6.4g} {loss:12.4g} {off:8.4f} {zero:8.4f} {len(ranged.warnings)}",
            flush=True,
        )
        found += 1
        worst = max(worst, abs(off))
    print(f"largest deviation: {worst:.4f}")
    return int(worst > 0.1)


if __name__ == "__main__":
    sys.exit(main())
