"""From a measured height profile to its loss: level, make periodic, limit the band, run the loop.

    python examples/measured_profile.py                  a measurement made up for the purpose
    python examples/measured_profile.py trace.csv        one of yours: columns x, z in m
    python examples/measured_profile.py --periodicity    what windowing and mirroring do (minutes)

Why each step is needed, and what it does to the loss: docs/measured-profile.md.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from adhesis import (
    HalfSpace,
    LoopResult,
    Problem,
    Profile,
    make_method,
    profile_from_heights,
    run_loop,
    self_affine_profile,
)

Array = NDArray[np.float64]

MATERIAL = HalfSpace(young=1e6, poisson=0.5)  # a soft elastomer
WORK_OF_ADHESION = 0.04  # J/m²
MAX_PENETRATION, LOAD_STEPS = 0.9, 40  # in units of h_max
CUT_OFFS = (200e-6, 100e-6, 50e-6, 25e-6, 12.5e-6, 6.25e-6)  # shortest wavelength kept, in m


# ---------------------------------------------------------------------- the measurement


def made_up_measurement(seed: int = 7) -> tuple[Array, Array]:
    """Positions and heights in m as a profilometer gives them: 2 mm in steps of 1 µm.

    A piece of a self-affine profile (H = 0.8, waves from 0.4 mm down to 5 µm, 1 µm rms) that is no
    period of it, on a sample tilted by 2 mrad, with 5 nm of noise.
    """
    rough = self_affine_profile(0.8, period=8e-3, n0=20, ratio=80, seed=seed, h_rms=1e-6)
    x: Array = 1e-6 * np.arange(2001.0)
    noise = 5e-9 * np.random.default_rng(seed).standard_normal(x.size)
    return x, rough.at(x) + 2e-3 * x + noise


def write_trace(path: Path, x: Array, z: Array) -> None:
    """Write a trace as a CSV of two columns."""
    np.savetxt(path, np.column_stack([x, z]), delimiter=",", header="x (m), z (m)", fmt="%.9e")


def read_trace(path: Path) -> tuple[Array, Array]:
    """Read a CSV of x and z in m, and put it on equal steps if it is not."""
    x, z = np.loadtxt(path, delimiter=",", unpack=True)
    order = np.argsort(x)
    x, z = x[order], z[order]
    steps = np.diff(x)
    if not np.allclose(steps, steps.mean(), rtol=1e-3):
        even = np.linspace(x[0], x[-1], x.size)
        x, z = even, np.interp(even, x, z)
    return x, z


# ---------------------------------------------------------------------- one period of a profile


def levelled(x: Array, z: Array) -> Array:
    """Heights less the straight line through them (least squares): tilt is no roughness."""
    middle = x - x.mean()
    return np.asarray(z - z.mean() - (z @ middle) / (middle @ middle) * middle)


def mirrored(z: Array) -> Array:
    """One period made of the trace and its mirror image: no step where the period closes."""
    return np.concatenate([z, z[-2:0:-1]])


def windowed(z: Array, part: float = 0.05) -> Array:
    """One period made by fading both ends out over a part of the length (Tukey's window)."""
    from scipy.signal.windows import tukey

    return np.asarray(z[:-1] * tukey(z.size, 2 * part)[:-1])


def band_limited(period_heights: Array, period: float, shortest: float) -> Profile:
    """Profile with the waves of a period no shorter than ``shortest`` (m)."""
    highest = int(period / shortest + 1e-9)
    # So many equally spaced heights hold so many waves, exactly: what `--heights` wants, too.
    return profile_from_heights(resampled(period_heights, highest), period)


def resampled(period_heights: Array, highest: int) -> Array:
    """Heights at 2M + 1 equally spaced places that hold the waves 0 … M, and no other."""
    n = period_heights.size
    if 2 * highest >= n:
        raise ValueError(f"{n} heights a period do not hold {highest} waves")
    waves = np.fft.rfft(period_heights)[: highest + 1] / n
    nodes = 2 * highest + 1
    return np.asarray(np.fft.irfft(waves, nodes) * nodes)


# ---------------------------------------------------------------------- the loop


def loop_of(profile: Profile) -> LoopResult:
    """One loop: to Δ/h_max = 0.9 and off again."""
    method = make_method("auto", Problem(profile, MATERIAL, WORK_OF_ADHESION), accuracy=1e-3)
    return run_loop(method, max_penetration=MAX_PENETRATION, load_steps=LOAD_STEPS)


def jump_table(loop: LoopResult) -> str:
    """Numbers of jumps and their energy drops, by kind."""
    drops: dict[tuple[str, str], list[float]] = defaultdict(list)
    for jump in loop.jumps:
        scale = "small scale" if jump.small_scale else "large scale"
        drops[scale, jump.kind].append(jump.energy_drop)
    lines = ["mechanism     kind         jumps   drops in mJ/m²   share"]
    for (scale, kind), found in sorted(drops.items()):
        share = sum(found) / loop.loss_from_drops
        lines.append(f"{scale}   {kind:<10} {len(found):7d} {1e3 * sum(found):16.3f} {share:7.1%}")
    return "\n".join(lines)


def draw(loop: LoopResult, x: Array, z: Array, path: Path) -> None:
    """The trace as it was measured and as it was used; the loop."""
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(6.9, 2.7), layout="constrained")
    profile = loop.problem.profile
    left.plot(1e3 * x, 1e6 * z, color="0.6", lw=0.8, label="measured")
    place = x - x[0]
    left.plot(1e3 * x, 1e6 * profile.at(place), color="#0072B2", lw=0.9, label="used")
    left.set(xlabel="position $x$ (mm)", ylabel="height (µm)")
    for branch, colour, line in (("loading", "#0072B2", "-"), ("unloading", "#D55E00", "--")):
        rows = loop.branch == branch
        right.plot(
            loop.penetration[rows], loop.mean_stress[rows] / 1e3, line, color=colour, label=branch
        )
    right.axhline(0, color="0.6", lw=0.6)
    right.set(xlabel=r"penetration $\Delta/h_\mathrm{max}$", ylabel=r"mean stress $\bar p$ (kPa)")
    right.set_title(f"loss {1e3 * loop.loss:.1f} mJ/m²", fontsize=9)
    for axes in (left, right):
        axes.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=200)


# ---------------------------------------------------------------------- what to run


def study(trace: Path, folder: Path) -> None:
    """Print the loss of a trace and how far it can be trusted; write heights and a figure."""
    x, z = read_trace(trace)
    length = x[-1] - x[0]
    level = levelled(x, z)
    tilt = (z - level)[-1] - (z - level)[0]
    print(
        f"{trace}: {x.size} heights over {1e3 * length:g} mm, tilt {1e3 * tilt / length:.3f} mrad, "
        f"{1e6 * level.std():.3f} µm rms when level"
    )
    closed = windowed(level)
    usable = [cut for cut in CUT_OFFS if cut > 4 * length / (x.size - 1)]
    print("\nshortest wave   waves        m2   h_max      loss  pull-off    audit   small  CPU")
    print("           µm                        µm     mJ/m²       kPa        %   scale    s")
    loops = []
    for cut in usable:
        loops.append(loop_of(band_limited(closed, length, cut)))
        show(f"{1e6 * cut:13g}", loops[-1])
    loop, coarser = loops[-1], loops[-2]
    other = loop_of(band_limited(mirrored(level), 2 * length, usable[-2]))
    show(f"mirrored {1e6 * usable[-2]:4g}", other)
    print(f"\nJumps with waves down to {1e6 * usable[-1]:g} µm:")
    print(jump_table(loop))
    print(
        f"\nloss {1e3 * loop.loss:.2f} mJ/m²; the last halving of the shortest wave changed it by "
        f"{loop.loss / coarser.loss - 1:+.1%};\na mirror instead of a window changes it by "
        f"{other.loss / coarser.loss - 1:+.1%} (waves down to {1e6 * usable[-2]:g} µm); "
        f"the energy audit leaves {loop.audit_residual:+.1e}"
    )
    heights = folder / "heights.csv"
    np.savetxt(heights, resampled(closed, loop.problem.profile.highest_harmonic))
    figure = folder / "measured_profile.png"
    draw(loop, x, z, figure)
    print(
        f"wrote {heights} and {figure}; the same loop:\n"
        f"adhesis loop --heights {heights} --period {length:.12g} "
        f"--work-of-adhesion {WORK_OF_ADHESION:g} --young {MATERIAL.young:g} "
        f"--poisson {MATERIAL.poisson:g} --max-penetration {MAX_PENETRATION:g} "
        f"--load-steps {LOAD_STEPS}"
    )


def show(label: str, loop: LoopResult) -> None:
    """One line of the table of losses."""
    profile = loop.problem.profile
    small = sum(jump.energy_drop for jump in loop.jumps if jump.small_scale)
    print(
        f"{label} {profile.highest_harmonic:7d} {profile.m2:9.2e} {1e6 * profile.h_max:7.3f} "
        f"{1e3 * loop.loss:9.2f} {1e-3 * loop.pull_off_stress:9.2f} "
        f"{1e2 * loop.audit_residual:8.4f} {small / loop.loss_from_drops:7.1%} {loop.seconds:4.1f}"
    )


def periodicity(seeds: int = 10) -> None:
    """Loss of profiles whose period is known, and what window and mirror make of one period."""
    print("longest waves   loss in mJ/m²   windowed         mirrored")
    for waves in (5, 10, 20):
        length = 0.4e-3 * waves
        x: Array = np.arange(0, length + 0.5e-6, 1e-6)
        losses, changes = [], []
        for seed in range(seeds):
            true = self_affine_profile(
                0.8, period=length, n0=waves, ratio=16, seed=seed, h_rms=1e-6
            )
            losses.append(loop_of(true).loss)
            if waves > 10:  # the mirrored ones would take minutes
                continue
            level, cut = levelled(x, true.at(x)), true.shortest_wavelength
            window = loop_of(band_limited(windowed(level), length, cut))
            mirror = loop_of(band_limited(mirrored(level), 2 * length, cut))
            changes.append([window.loss / losses[-1] - 1, mirror.loss / losses[-1] - 1])
        line = f"{waves:13d} {1e3 * np.mean(losses):7.1f} ± {1e3 * np.std(losses, ddof=1):4.1f}"
        for column in np.transpose(changes):
            line += f"   {np.mean(column):+6.1%} ± {np.std(column, ddof=1):5.1%}"
        print(line)
    print("±: standard deviation over the profiles")


def main() -> None:
    """Read the options and run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("trace", nargs="?", type=Path, help="CSV: columns x, z in m")
    parser.add_argument("--to", type=Path, default=Path("."), metavar="DIR", help="for the files")
    parser.add_argument("--periodicity", action="store_true", help="what closing the period does")
    args = parser.parse_args()
    if args.periodicity:
        periodicity()
        return
    args.to.mkdir(parents=True, exist_ok=True)
    if args.trace is None:
        args.trace = args.to / "trace.csv"
        write_trace(args.trace, *made_up_measurement())
    study(args.trace, args.to)


if __name__ == "__main__":
    main()
