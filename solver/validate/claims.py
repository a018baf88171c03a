"""Compare the methods with closed forms: :func:`validate` returns rows of (claim, error, bound).

Claims and the reasons for their bounds (see also ``judge``):

*   losses: the stated error of the method (grid: 0.5 % with at most 4096 nodes; sharp: 1e-8 of the
    drops, 1e-5 of the loop integral);
*   energies along the branch: the adhesion energy 2γe of the resolution e at both edges;
*   a small contact, compared with a parabola: with ψ = πa/λ the repulsion is smaller by less than
    a share ψ²/3, the tension larger by less than ψ²/6 (1 + ψ²), exactly from the closed forms;
*   a stiffness or a load: as a fixed separation, but the load at which contact is lost is known to
    the error of the elastic solution, and s there to its square root;
*   almost full contact, compared with full contact: by reciprocity ½⟨σh⟩ = U_full + ½⟨σ_full t⟩
    exactly, so the difference is at most ½ s max|σ_full| over the gaps.

The closed forms of the third and the last claim describe a slightly different problem, and the
bound is the leading order of that difference. The error of even an exact method is then close to
its bound; the note gives the exact difference of the two problems.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from adhesis.solver.loading.loop import run_loop
from adhesis.solver.model.control import Control
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array, Profile, self_affine_profile
from adhesis.solver.references.full_contact import full_contact_energy, full_contact_stress
from adhesis.solver.references.parabola import parabola_load, parabola_pull_off
from adhesis.solver.references.periodic_punch import pull_off_stress
from adhesis.solver.registry import MethodName, make_method
from adhesis.solver.validate.judge import (
    ALPHAS,
    AMPLITUDE,
    GRIDS,
    HALF_SPACE,
    METHODS,
    MODULUS,
    PERIOD,
    STANDARDS,
    STIFFNESSES,
    Judge,
    Row,
    joined,
    problem_of,
    wave_of,
)

__all__ = ["METHODS", "Row", "validate"]


def validate(
    method_names: Sequence[MethodName] = METHODS, *, on_row: Callable[[Row], None] | None = None
) -> list[Row]:
    """Compare the methods with the closed forms.

    Parameters
    ----------
    method_names : sequence of str
        Of :data:`METHODS`.
    on_row : callable, optional
        Called with every row when it is complete.

    Raises
    ------
    ValueError
        For a name that is not in :data:`METHODS`.
    """
    rows: list[Row] = []
    for name in method_names:
        if name not in STANDARDS:
            raise ValueError(f"method is {name!r}: validated are {', '.join(METHODS)}")
        for row in _rows(name):
            rows.append(row)
            if on_row is not None:
                on_row(row)
    return rows


def _rows(name: MethodName) -> Iterator[Row]:
    judge = Judge(name)
    nan = float("nan")
    for claim in CLAIMS:
        try:
            yield from claim(judge)
        except RuntimeError as error:
            # An error of a method is a failed claim and does not end the validation.
            about = (claim.__doc__ or "").rstrip(".")
            yield judge.row(about, nan, nan, f"did not finish: {error}")


def losses(judge: Judge) -> Iterator[Row]:
    """Loss of the single wave."""
    for alpha in ALPHAS:
        wave, result = judge.wave_loop(alpha)
        claim = f"loss of the single wave, α = {alpha:g}"
        yield from judge.losses(claim, result, wave.loop.loss)


def order(judge: Judge) -> Iterator[Row]:
    """Order of convergence of the loss."""
    if judge.standard.nodes is None:
        return  # a method without a grid
    errors = []
    for n in GRIDS:
        squares = []
        for alpha in ALPHAS:
            wave = wave_of(alpha)
            if n == judge.standard.nodes:
                _, result = judge.wave_loop(alpha)
            else:
                method = judge.method(problem_of(wave), n)
                result = run_loop(method, max_penetration=0.05, load_steps=1)
            squares.append((result.loss_from_drops / wave.loop.loss - 1) ** 2)
        errors.append(float(np.sqrt(np.mean(squares))))
    order = -float(np.polyfit(np.log(GRIDS), np.log(errors), 1)[0])
    yield judge.row(
        "order of convergence of the loss is 1: shortfall",
        max(0.0, 1 - order),
        0.2,
        f"order {order:.2f}, rms error over α {errors[0]:.1e} to {errors[-1]:.1e}",
        f"{GRIDS[0]} to {GRIDS[-1]} nodes",
    )


def branch(judge: Judge) -> Iterator[Row]:
    """States of the branch against Johnson."""
    widths, stresses, energies = [], [], []
    for alpha in ALPHAS:
        wave, result = judge.wave_loop(alpha)
        on_axis = np.flatnonzero(result.load_step & (result.patches > 0))
        s = result.separation[on_axis]
        keep = s < wave.loop.fold_separation  # a state can outlive the fold by rounding
        on_axis, s = on_axis[keep], s[keep]
        a = np.array([wave.half_width(float(value)) for value in s])
        p_star = wave.full_contact_stress
        widths.append(result.contact_fraction[on_axis] / 2 - a / PERIOD)
        off = (result.mean_stress[on_axis] - wave.mean_stress(a)) / p_star
        stresses.append((off, judge.error_of_half_width(wave.mean_stress_at, a, s) / p_star))
        off = (result.energy[on_axis] - wave.energy(a)) / wave.energy_scale
        one_node = 2 * wave.work_of_adhesion * PERIOD * judge.standard.edge
        energies.append((off, np.full(a.size, one_node / wave.energy_scale)))
    johnson = "branch against Johnson, all α:"
    edge = np.array(judge.standard.edge)
    yield judge.worst(f"{johnson} half-width / λ", np.concatenate(widths), edge)
    yield judge.worst(f"{johnson} mean stress / p*", *joined(stresses))
    yield judge.worst(f"{johnson} energy / (λ A p*)", *joined(energies))


def fold(judge: Judge) -> Iterator[Row]:
    """Pull-off of the single wave."""
    separations, stresses = [], []
    for alpha in ALPHAS:
        wave, result = judge.wave_loop(alpha)
        loop = wave.loop
        reach = loop.fold_separation - wave.amplitude
        separations.append((result.jumps[-1].separation - loop.fold_separation) / reach)
        stress = result.mean_stress[np.flatnonzero(result.patches)[-1]]
        a, s = np.array([loop.fold_half_width]), np.array([loop.fold_separation])
        # The edges of the last state are within e of equilibrium ones, those within e of the fold.
        bound = judge.error_of_half_width(wave.mean_stress_at, a, s) / wave.full_contact_stress
        off = np.array([(stress - loop.fold_mean_stress) / wave.full_contact_stress])
        stresses.append((off, 2 * bound))
    yield judge.worst(
        "pull-off of the single wave, all α: (s_out - s) / (s_out - A)",
        np.array(separations),
        np.array(judge.standard.loss),
    )
    yield judge.worst("pull-off of the single wave, all α: p̄_out / p*", *joined(stresses))


def westergaard(judge: Judge) -> Iterator[Row]:
    """Contact without adhesion against Westergaard."""
    wave = wave_of(0.0)
    problem = problem_of(wave)
    method = judge.method(problem)
    result = run_loop(method, max_penetration=0.9, load_steps=10)
    below = result.separation < problem.profile.h_max  # at first touch the width is zero
    pressed = np.flatnonzero(result.load_step & below)
    s = result.separation[pressed]
    a = np.array([wave.half_width(float(value)) for value in s])
    p_star = wave.full_contact_stress
    width = result.contact_fraction[pressed] / 2 - a / PERIOD
    off = (result.mean_stress[pressed] - wave.mean_stress(a)) / p_star
    nodes = judge.standard.nodes or GRIDS[-1]
    states = [result.contact_states[i] for i in pressed]
    peak = np.array([method.fields(state, nodes).stress[0] for state in states]) / p_star

    def highest(a: Array, s: Array) -> Array:
        """Compute σ(0) with the half-width a at s."""
        y = np.sin(np.pi * a / PERIOD) ** 2
        tension = p_star * y - wave.mean_stress_at(a, s)
        return np.asarray(2 * p_star * np.sqrt(y) - tension / np.sqrt(y))

    gamma0 = "γ = 0 against Westergaard:"
    edge = np.array(judge.standard.edge)
    yield judge.worst(f"{gamma0} half-width / λ", width, edge)
    mean = judge.error_of_half_width(wave.mean_stress_at, a, s) / p_star
    yield judge.worst(f"{gamma0} mean stress / p*", off, mean)
    top = judge.error_of_half_width(highest, a, s) / p_star
    yield judge.worst(f"{gamma0} highest stress / p*", peak - highest(a, s) / p_star, top)
    drops = abs(result.loss_from_drops) / wave.energy_scale * PERIOD
    yield judge.row(f"{gamma0} no energy drops / (A p*)", drops, 1e-9)
    work = result.energy.max() / wave.energy_scale
    loss = abs(result.loss) / wave.energy_scale * PERIOD
    bound = judge.standard.loop_integral * work
    yield judge.row(f"{gamma0} no loop integral / (A p*)", loss, bound)


def full_contact(judge: Judge) -> Iterator[Row]:
    """Almost full contact of three waves."""
    waves = np.array([0, 0.5, 0.2 * np.exp(1j), 0.1 * np.exp(2j)], dtype=np.complex128)
    profile = Profile(PERIOD, waves).scaled(AMPLITUDE)
    gamma = 10 * MODULUS * AMPLITUDE**2 / PERIOD  # strong: only one gap stays open
    problem = Problem(profile, HALF_SPACE, gamma)
    method = judge.method(problem)
    state = method.detached(profile.h_max)
    for penetration in (0.0, 0.5, 0.9, 0.99):
        state = method.follow(state, problem.separation(penetration)).states[-1]
    n = judge.standard.nodes or GRIDS[-1]
    f = method.fields(state, n)
    full = full_contact_stress(profile, MODULUS, f.x)
    energy = full_contact_energy(profile, MODULUS)
    # The elastic energy of the state is ½⟨σ(h - s)⟩ per area; ½⟨σh⟩ follows.
    work = state.elastic_energy / PERIOD + 0.5 * state.separation * state.mean_stress
    bound = 0.5 * state.separation * float(np.abs(full[f.gap > 0]).max()) / energy
    reciprocal = energy + 0.5 * float(np.mean(full * f.gap))
    note = f"Δ/h_max = 0.99, A/A0 = {state.contact_fraction:.3f}"
    own = f"{note}; the gap that is left makes {abs(reciprocal / energy - 1):.1e}"
    yield judge.row("full contact, three waves: energy", work / energy - 1, bound, own)
    # The mean over n nodes has an error of one node at either end of the gap.
    ends = 2 / n * bound / (1 - state.contact_fraction)
    claim = "full contact, three waves: ½⟨σh⟩ = U_full + ½⟨σ_full t⟩"
    yield judge.row(claim, work / reciprocal - 1, ends, note)


def punch(judge: Judge) -> Iterator[Row]:
    """Koiter's punch: the strongly adhesive wave."""
    wave = wave_of(3.0)
    result = run_loop(judge.method(problem_of(wave)), max_penetration=0.5, load_steps=5)
    on = np.flatnonzero((result.branch == "unloading") & (result.patches > 0))
    width = result.contact_fraction[on] / 2 * PERIOD
    hertzian = wave.full_contact_stress * np.sin(np.pi * width / PERIOD) ** 2
    punch = pull_off_stress(width, PERIOD, MODULUS, wave.work_of_adhesion)
    bounds = judge.error_at_given_width(wave, width, result.separation[on]) / np.abs(punch)
    errors = (result.mean_stress[on] - hertzian) / punch - 1
    yield judge.worst("Koiter's punch: tension of the wave at α = 3", errors, bounds)


def parabola(judge: Judge) -> Iterator[Row]:
    """Small contacts against the parabola."""
    wave = wave_of(0.02)
    radius = PERIOD**2 / (4 * np.pi**2 * AMPLITUDE)
    method = judge.method(problem_of(wave))
    result = run_loop(method, max_penetration=0.003, load_steps=1)
    on = np.flatnonzero((result.branch == "unloading") & (result.patches > 0))
    gamma, p_star = wave.work_of_adhesion, wave.full_contact_stress
    a = result.contact_fraction[on] / 2 * PERIOD

    def curved(a: Array) -> Array:
        """Bound the difference in mean stress between the wave's contact and the parabola's."""
        psi2 = (np.pi * a / PERIOD) ** 2
        repulsion = parabola_load(a, radius, MODULUS, 0.0) / PERIOD
        tension = repulsion - parabola_load(a, radius, MODULUS, gamma) / PERIOD
        return np.asarray(repulsion * psi2 / 3 + tension * psi2 / 6 * (1 + psi2))

    errors = result.mean_stress[on] - parabola_load(a, radius, MODULUS, gamma) / PERIOD
    bounds = curved(a) + judge.error_at_given_width(wave, a, result.separation[on])
    own = np.abs(wave.mean_stress(a) * PERIOD - parabola_load(a, radius, MODULUS, gamma))
    most = own.max(initial=0) / PERIOD / p_star
    note = f"the wave itself differs from the parabola by up to {most:.1e}"
    claim = "parabola: mean stress / p* at a half-width"
    yield judge.worst(claim, errors / p_star, bounds / p_star, note)
    a_least, load = parabola_pull_off(radius, MODULUS, gamma)
    least = np.array([a_least])
    s = np.asarray(wave.separation(least))
    bound = float((curved(least) + judge.error_of_half_width(wave.mean_stress_at, least, s))[0])
    error = result.pull_off_stress * PERIOD / load + 1
    largest = wave.mean_stress(a_least * np.linspace(0.7, 1.4, 10_001)).min()
    own = abs(largest * PERIOD / load - 1)
    note = f"the wave itself pulls off at a load that differs by {own:.1e}"
    yield judge.row("parabola: pull-off load", error, -bound * PERIOD / load, note)


def controls(judge: Judge) -> Iterator[Row]:
    """The wave held by a stiffness, and under a load."""
    wave = wave_of(0.2)
    p_star = wave.full_contact_stress
    for relative in STIFFNESSES:
        stiffness = relative * p_star / wave.amplitude
        exact = wave.loop_under(stiffness)
        problem = replace(problem_of(wave), control=Control(stiffness))
        result = run_loop(
            judge.method(problem),
            max_penetration=0.1 if stiffness else None,
            max_stress=None if stiffness else 0.1 * p_star,
            load_steps=2,
        )
        held = f"wave held by k = {relative:g} p*/A" if stiffness else "wave under a load"
        # At the loss of contact s varies as a square root of the load, which is known to the error
        # of the elastic solution, and the loop under a load is closed there.
        late = 0.0
        if stiffness == 0:
            a = wave.half_width_under(0.0, exact.fold_mean_stress + judge.standard.stress * p_star)
            way = exact.fold_separation - float(wave.separation(a))
            late = abs(way * exact.fold_mean_stress) / exact.loss
        yield from judge.losses(f"{held}: loss", result, exact.loss, late)
        last = np.flatnonzero(result.patches)[-1]
        off = (result.mean_stress[last] - exact.fold_mean_stress) / p_star
        s = np.array([exact.fold_separation])
        half_width = np.array([exact.fold_half_width])
        bound = judge.error_of_half_width(wave.mean_stress_at, half_width, s)[0] / p_star
        yield judge.row(f"{held}: p̄_out / p*", off, 2 * bound)


def audit(judge: Judge) -> Iterator[Row]:
    """Energy audit: loop integral = sum of drops."""
    profile = self_affine_profile(0.8, period=2e-3 * np.pi, n0=2, ratio=16, seed=1, h_rms=1e-6)
    problem = Problem(profile, HALF_SPACE, 0.01)
    accuracy = max(judge.standard.accuracy, 1e-3)
    method = make_method(judge.name, problem, accuracy=accuracy)
    result = run_loop(method, max_penetration=0.9, load_steps=40)
    kinds = sorted({jump.kind for jump in result.jumps})
    yield judge.row(
        "energy audit of a rough loop: loop integral against sum of drops",
        result.audit_residual,
        0.01,
        f"H = 0.8, harmonics 2 to 32; {len(result.jumps)} jumps: {', '.join(kinds)}",
        f"{method.nodes} nodes" if judge.standard.nodes else "",
    )


CLAIMS = (
    losses, order, branch, fold, westergaard, full_contact, punch, parabola, controls, audit,
)  # fmt: skip
