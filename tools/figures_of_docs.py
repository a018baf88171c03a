"""Makes the figures of README and docs/ again, each by its command, stamped with the commit.

    make figures-of-docs                         all of them (an hour of two cores)
    make figures-of-docs ARGS='loop paper'       some

A stamp is a text "Source" inside the PNG: version and commit of adhesis, and the command.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from PIL.PngImagePlugin import PngInfo

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from adhesis.ensemble.versions import commit, versions  # noqa: E402  # needs the path

BESIDE = tuple(sorted((ROOT / "jobs" / "beside").glob("*.toml")))
KEPT = (".png", ".csv", ".md")  # PDF, NetCDF and HTML are made anew by whoever wants them


@dataclass(frozen=True)
class Part:
    """Figures that commands make: words after ``python``; OUT is a folder for what they make."""

    commands: tuple[str, ...]
    made: str  # glob of what is kept, below OUT
    folder: str  # where that goes, below docs/
    name: str = ""  # under which name, if it has another one there
    data: str = ""  # where its CSV files go, below the checkout


def _paper() -> tuple[str, ...]:
    runs = [f"-m adhesis run {path} --out OUT/{path.stem}.h5" for path in BESIDE]
    beside = " ".join(f"OUT/{path.stem}.h5" for path in BESIDE)
    return (
        "-m adhesis run jobs/paper.toml --out OUT/paper.h5",
        *runs,
        f"-m adhesis report OUT/paper.h5 --to OUT/paper --beside {beside}",
    )


_DRAWN = ("loop", "structure", "zero_range", "one_asperity", "two_scales", "two_methods")
PARTS = {
    **{
        name.replace("_", "-"): Part(
            (f"docs/figures/{name}.py OUT/{name}.png",), f"{name}.png", "figures"
        )
        for name in _DRAWN
    },
    "loss-of-range": Part(
        ("benchmarks/loss_of_range.py figure OUT/loss_of_range.png",), "*.png", "figures"
    ),
    "tutorial": Part(
        ("-m tools.transcripts docs/tutorial.md --keep OUT",), "first_*.png", "figures"
    ),
    "measured": Part(
        ("examples/measured_profile.py --to OUT",), "trace.png", "figures", "measured_profile.png"
    ),
    "bench": Part(("-m adhesis bench --budget 240 --to OUT",), "benchmark.png", "figures"),
    "paper": Part(_paper(), "paper/*.*", "paper", data="study/paper"),
}


def stamp(path: Path, text: str) -> None:
    """Put a text into a PNG, in place of an older one."""
    about = PngInfo()
    about.add_text("Source", text)
    with Image.open(path) as picture:
        picture.save(path, pnginfo=about, dpi=picture.info.get("dpi"))


def make(name: str, ranks: int) -> None:
    """Run the commands of a part and put what they made into docs/, stamped."""
    part = PARTS[name]
    source = f"adhesis {versions()['adhesis_version']}, commit {commit()}"
    with tempfile.TemporaryDirectory() as folder:
        for command in part.commands:
            words = command.replace("OUT", folder).split()
            if ranks > 1 and words[:3] == ["-m", "adhesis", "run"]:
                words += ["--ranks", str(ranks)]
            print("python", *words, flush=True)
            subprocess.run([sys.executable, *words], cwd=ROOT, check=True)
        for path in sorted(Path(folder).glob(part.made)):
            if path.suffix not in KEPT:
                continue
            place = Path(part.data) if path.suffix == ".csv" else Path("docs", part.folder)
            to = ROOT / place / (part.name or path.name)
            shutil.copyfile(path, to)
            if to.suffix == ".md":  # links to what is not kept
                to.write_text(re.sub(r" \(\[PDF\]\([^)]*\)\)", "", to.read_text("utf-8")), "utf-8")
            if to.suffix == ".png":
                stamp(to, f"{source}: make figures-of-docs ARGS={name}")
            print(to.relative_to(ROOT), flush=True)


def main() -> None:
    """Make all, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0], allow_abbrev=False)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="default: all")
    parser.add_argument("--ranks", type=int, default=1, help="ranks of the campaigns' runs")
    args = parser.parse_args()
    for name in args.parts or PARTS:
        make(name, args.ranks)


if __name__ == "__main__":
    main()
