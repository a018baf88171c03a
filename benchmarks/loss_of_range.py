"""Loss against the range of adhesion, of ``sharp`` and of an independent minimisation.

    python benchmarks/loss_of_range.py table [--scenes paper 1GPa steel] [--most-nodes 40000]
    python benchmarks/loss_of_range.py figure OUT.png

The first prints the loss of loops at ranges that are shares of ``edge_range``, over that of zero
range: ``sharp`` with that range in the model, where it is allowed, and the minimisation of the
energy on a grid (``finite_range.py``, law and steps of its loops), where its nodes resolve the
zones. What it printed is kept in ``loss_of_range.txt``, of which the second draws
docs/figures/loss_of_range.png.

Scenes of H = 0.8, h_rms = 1 µm, γ = 0.04 J/m², ν = 0.5, Δ/h_max = 0.9: the paper's profile with
seed 1; and n0 = 2, ratio 25, period 2 mm, seed 0 with E = 1 GPa and 200 GPa.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from finite_range import NODES_OF_ZONE, GridLoop
from scipy.fft import next_fast_len

from adhesis import HalfSpace, Problem, make_method, run_loop, self_affine_profile
from adhesis.solver.method import PathError

GAMMA, DEPTH = 0.04, 0.9
NARROW = {"period": 2e-3, "n0": 2, "ratio": 25, "seed": 0}
SCENES = {
    "paper": ({"period": 2e-3 * np.pi, "n0": 10, "ratio": 100, "seed": 1}, 1e6),
    "1GPa": (NARROW, 1e9),
    "steel": (NARROW, 2e11),
}
TITLES = {
    "paper": "the paper's scene, E = 1 MPa",
    "1GPa": "ratio 25, E = 1 GPa",
    "steel": "ratio 25, E = 200 GPa",
}
SHARES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.67, 1.0, 1.5, 2.0)  # of edge_range
HEAD = "scene edge_share range_nm sharp openings barrier warnings grid nodes"
KEPT = Path(__file__).with_suffix(".txt")


def problem_of(scene: str, adhesion_range: float | None = None) -> Problem:
    """Problem of a scene at a range in m."""
    shape, young = SCENES[scene]
    profile = self_affine_profile(0.8, h_rms=1e-6, **shape)
    return Problem(profile, HalfSpace(young, 0.5), GAMMA, adhesion_range=adhesion_range)


def loss_on_grid(problem: Problem, delta: float, nodes: int, share: float) -> float:
    """Loss in J/m² by the minimisation at a range in m; ``share`` is that of a step."""
    q0, modulus = problem.profile.q0, problem.half_space.modulus
    height = q0 * problem.profile.heights(nodes)
    grid = GridLoop(height, GAMMA * q0 / modulus, delta * q0)
    turn, step = q0 * problem.separation(DEPTH), 2 * delta * q0
    return float(grid.loss(turn, step, share * q0 / modulus) * modulus / q0)


def nodes_of(problem: Problem, delta: float) -> int:
    """Nodes that resolve waves and zones."""
    zone = np.pi / 4 * problem.half_space.modulus * delta**2 / GAMMA
    of_zones = NODES_OF_ZONE * problem.profile.period / zone
    most = max(of_zones, 16 * problem.profile.highest_harmonic)
    return int(next_fast_len(int(np.ceil(most)), real=True))


def table(scenes: list[str], most_nodes: int, shares: list[float]) -> None:
    """Print a row for each range, and the four ranges of each scene."""
    print(HEAD)
    for scene in scenes:
        zero = run_loop(make_method("sharp", problem_of(scene)), max_penetration=DEPTH)
        ranges = " ".join(f"{1e9 * one:.4g}" for one in (zero.valid_range, *zero.outer_ranges))
        print(f"# {scene}: {zero.loss:.6g} J/m²; valid edge touch turn {ranges} nm", flush=True)
        for share in shares:
            delta = share * zero.edge_range
            cells = ["-"] * 4
            try:
                ranged = problem_of(scene, delta)
                loop = run_loop(make_method("sharp", ranged), max_penetration=DEPTH)
                cells = [f"{loop.loss / zero.loss:.5f}", f"{loop.openings}"]
                cells += ["-", f"{len(loop.warnings)}"]
            except (ValueError, PathError) as error:  # the range is refused, or the path is lost
                print(f"# {str(error)[:100]}")
            nodes, grid = nodes_of(zero.problem, delta), "-"
            if nodes <= most_nodes:
                loss = loss_on_grid(zero.problem, delta, nodes, 0.01 * zero.loss)
                grid = f"{loss / zero.loss:.5f}"
            print(f"{scene} {share:g} {1e9 * delta:.4g}", *cells, grid, nodes, flush=True)


def figure(path: Path) -> None:
    """Draw the kept table."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    lines = KEPT.read_text("utf-8").splitlines()
    figure, panels = plt.subplots(1, len(SCENES), figsize=(11, 3.8), layout="constrained")
    for axes, (scene, title) in zip(panels, TITLES.items(), strict=True):
        (head,) = (line for line in lines if line.startswith(f"# {scene}: "))
        valid, edge, touch, _ = map(float, head.removesuffix(" nm").split()[-4:])
        rows = np.array([line.split() for line in lines if line.startswith(f"{scene} ")])
        numbers = np.where(rows[:, 2:] == "-", "nan", rows[:, 2:]).astype(float)
        delta, sharp, _, _, warnings, grid = numbers.T[:6]
        known, sure = np.isfinite(sharp), warnings == 0
        axes.plot(delta[known], sharp[known], "-", color="#1f5fa8", lw=1, label="sharp")
        axes.plot(delta[sure], sharp[sure], "o", color="#1f5fa8", ms=5, label="without a doubt")
        doubtful = known & ~sure
        open_ = {"mfc": "white", "color": "#1f5fa8", "ms": 5, "label": "doubtful"}
        axes.plot(delta[doubtful], sharp[doubtful], "o", **open_)
        axes.plot(delta, grid, "x", color="#c4472b", ms=7, label="minimisation")
        for name, at in (("inside", valid), ("edge", edge), ("touch", touch)):
            if at > 2 * delta.max():
                continue
            axes.axvline(at, color="0.6", lw=0.8, zorder=0)
            side = "left" if name == "touch" else "right"
            place = {"transform": axes.get_xaxis_transform(), "rotation": 90, "va": "bottom"}
            axes.text(at, 0.03, f" {name} ", ha=side, fontsize=8, color="0.4", **place)
        axes.set(xscale="log", xlabel="range δ (nm)", title=title)
        axes.set(
            **({"yscale": "log", "ylim": (2e-4, 2)} if scene == "steel" else {"ylim": (0, 1.1)})
        )
        axes.xaxis.set_minor_formatter(NullFormatter())
    panels[0].set_xticks([10, 30, 100, 300], ["10", "30", "100", "300"])
    panels[0].set_ylabel("loss over that of zero range")
    panels[0].legend(frameon=False, fontsize=8, loc="lower left")
    figure.savefig(path, dpi=160)


def main() -> None:
    """Print the table, or draw it."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("what", choices=["table", "figure"])
    parser.add_argument("out", nargs="?", type=Path)
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--shares", nargs="+", type=float, default=SHARES)
    parser.add_argument("--most-nodes", type=int, default=40_000)
    args = parser.parse_args()
    if args.what == "table":
        table(args.scenes, args.most_nodes, args.shares)
    else:
        figure(args.out)


if __name__ == "__main__":
    main()
