"""How often the 95 % interval of a mean holds the mean: at a fixed number, and at the stop.

    python benchmarks/precision_coverage.py --campaigns 1000
    python benchmarks/precision_coverage.py --study --campaigns 1000
    python benchmarks/precision_coverage.py --fixed --campaigns 20000

Losses are made up, of known mean 1. The first table is of campaigns with ``[stop]``: each cell gets
batches until the rule has enough, and the interval at that moment either holds 1 or does not. The
second is the same for the losses of the study (``study/data/loops.csv``): realisations are drawn,
with replacement, from those of one of its large cells, whose mean therefore is the true one. It has
W~ steered and W~ asked for, and then the loss in J/m² steered and W~ asked for. The third is of so
many realisations and no rule, Student's interval beside the one that is used.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from adhesis.ensemble.campaign.precision import enough, interval, looks, precision

STUDY = Path(__file__).resolve().parent.parent / "study" / "data" / "loops.csv"
FEWEST_OF_STUDY = 120

Array = NDArray[np.float64]
Draw = Callable[[np.random.Generator, tuple[int, int]], Array]


@dataclass(frozen=True)
class Losses:
    """Made-up losses of mean 1; ``std`` is that of one of them."""

    name: str
    draw: Draw
    std: float


def lognormal(sigma: float) -> Losses:
    """Of this standard deviation of the logarithm."""
    return Losses(
        f"lognormal, σ = {sigma:g}",
        lambda rng, shape: rng.lognormal(-(sigma**2) / 2, sigma, shape),
        float(np.sqrt(np.expm1(sigma**2))),
    )


def pareto(k: float) -> Losses:
    """Of density ∝ x^-(k + 1): no k-th moment."""
    return Losses(
        f"Pareto, exponent {k:g}",
        lambda rng, shape: (rng.pareto(k, shape) + 1) * (k - 1) / k,
        float(1 / np.sqrt(k * (k - 2))),
    )


KINDS = (
    Losses(
        "normal, standard deviation 0.25 of the mean",
        lambda rng, shape: rng.normal(1, 0.25, shape),
        0.25,
    ),
    lognormal(0.5),
    lognormal(1.0),
    Losses("exponential", lambda rng, shape: rng.exponential(1, shape), 1.0),
    Losses(
        "Student's t with 3 degrees, standard deviation 0.5",
        lambda rng, shape: 1 + 0.5 / np.sqrt(3) * rng.standard_t(3, shape),
        0.5,
    ),
    pareto(4.0),
    pareto(3.0),
    pareto(2.5),
)
# Numbers of realisations of the table without a rule.
FIXED = (3, 5, 7, 10, 20, 50, 100)


def at_the_stop(
    losses: Losses, wanted: float, campaigns: int, *, batch: int = 8, most: int = 1000
) -> tuple[float, float, float]:
    """Coverage, median number of realisations, and share of campaigns that went to the end."""
    rng = np.random.default_rng(11)
    at, held, counts = looks(batch, batch, most), 0, []
    for _ in range(campaigns):
        values = losses.draw(rng, (1, most))[0]
        count = enough(values, at, wanted)
        assert count is not None
        low, high = interval(values[:count])
        held += bool(low <= 1 <= high)
        counts.append(count)
    return held / campaigns, float(np.median(counts)), float(np.mean(np.array(counts) == most))


def at_a_number(losses: Losses, n: int, ensembles: int) -> tuple[float, float, float]:
    """Coverage of the interval and of Student's, and the ratio of their mean widths."""
    values = losses.draw(np.random.default_rng([11, n]), (ensembles, n))
    low, high = interval(values)
    mean, half = values.mean(axis=-1), stdtrit(n - 1, 0.975) * values.std(axis=-1, ddof=1)
    half = half / np.sqrt(n)
    return (
        float(np.mean((low <= 1) & (high >= 1))),
        float(np.mean(np.abs(mean - 1) <= half)),
        float(np.mean(high - low) / np.mean(2 * half)),
    )


def cells_of_the_study() -> Iterator[tuple[str, Array]]:
    """Name of each turning point and γ, and W~ and loss of one H there, each over its mean."""
    cells: dict[tuple[str, ...], list[tuple[float, float]]] = {}
    names = (
        "work_of_adhesion",
        "max_penetration",
        "hurst",
        "campaign",
        "ratio",
        "stiffness",
        "h_rms",
    )
    with STUDY.open(encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            if row["status"] == "done" and row["max_penetration"]:
                values = (float(row["loss_dimensionless"]), float(row["loss"]))
                cells.setdefault(tuple(row[name] for name in names), []).append(values)
    for (gamma, top, *_), loops in sorted(cells.items()):
        if len(loops) >= FEWEST_OF_STUDY:
            values = np.array(loops)
            yield f"γ = {gamma} J/m², Δ~max = {top}", values / values.mean(axis=0)


def of_the_study(
    loops: Array, steered: int, wanted: float, rng: np.random.Generator, campaigns: int, **rule: int
) -> tuple[float, float, float]:
    """Coverage of W~ at the stop, its median reach there, and median number of realisations.

    ``steered`` is the column that the rule looks at: 0 for W~, 1 for the loss.
    """
    at, held, counts, reach = looks(rule["batch"], rule["batch"], rule["most"]), 0, [], []
    for _ in range(campaigns):
        drawn = loops[rng.integers(0, len(loops), at[-1])]
        count = enough(drawn[:, steered], at, wanted)
        assert count is not None
        known = precision(drawn[:count, 0], wanted)
        held += known.estimate.low <= 1 <= known.estimate.high
        counts.append(count)
        reach.append(known.estimate.relative_error)
    return held / campaigns, float(np.median(reach)), float(np.median(counts))


def print_study(campaigns: int, batch: int, most: int) -> None:
    """Print a row for each γ and turning point of the study: mean over H, and the worst H."""
    places: dict[str, list[Array]] = {}
    for name, loops in cells_of_the_study():
        places.setdefault(name, []).append(loops)
    wishes = (0.2, 0.1, 0.05)
    for steered, title in enumerate(("W~ steered", "loss steered")):
        print(f"| {title} | std of W~ |", " | ".join(f"± {100 * w:g} %" for w in wishes), "|")
        for name, cells in places.items():
            row = []
            for wanted in wishes:
                found = np.array(
                    [
                        of_the_study(
                            *(loops, steered, wanted, np.random.default_rng([13, k]), campaigns),
                            batch=batch,
                            most=most,
                        )
                        for k, loops in enumerate(cells)
                    ]
                )
                held, reach, count = found.mean(axis=0)
                worst = found[:, 0].min()
                row.append(f"{held:.1%}, worst {worst:.1%} (± {100 * reach:.1f} %, {count:.0f})")
            std = np.mean([loops[:, 0].std(ddof=1) for loops in cells])
            print(f"| {name}, {len(cells)} H | {std:.2f} |", " | ".join(row), "|", flush=True)


def main() -> None:
    """Print one of the three tables."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0], allow_abbrev=False)
    parser.add_argument("--campaigns", type=int, default=1000)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--most", type=int, default=1000)
    parser.add_argument("--fixed", action="store_true", help="at fixed numbers, without a rule")
    parser.add_argument("--study", action="store_true", help="of the losses of the study")
    options = parser.parse_args()
    if options.study:
        print_study(options.campaigns, options.batch, options.most)
        return
    if options.fixed:
        print("| losses |", " | ".join(f"n = {n}" for n in FIXED), "|")
        for losses in KINDS:
            row = [at_a_number(losses, n, options.campaigns) for n in FIXED]
            cells = [f"{used:.3f}, {students:.3f}, {width:.2f}" for used, students, width in row]
            print(f"| {losses.name} |", " | ".join(cells), "|", flush=True)
        return
    print("| losses | ± 20 % | ± 10 % | ± 5 % |")
    for losses in KINDS:
        cells = []
        for wanted in (0.2, 0.1, 0.05):
            held, median, ended = at_the_stop(
                losses, wanted, options.campaigns, batch=options.batch, most=options.most
            )
            least = (1.96 * losses.std / wanted) ** 2
            end = f"; {ended:.0%} at the end" if ended else ""
            cells.append(f"{held:.1%} ({median:.0f} of {least:.0f}{end})")
        print(f"| {losses.name} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
