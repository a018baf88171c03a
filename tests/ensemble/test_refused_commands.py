"""Command lines that are refused: code 2, one sentence with the option's name, and nothing done."""

import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from adhesis.ensemble.campaign.file import load_campaign
from adhesis.ensemble.command.main import main
from adhesis.ensemble.results.layout import create
from adhesis.ensemble.run import launch
from tests.support.campaign_support import campaign_text, write_campaign
from tests.support.options import OF_WAVE, WAVE_HEIGHTS, forbid_work, replacing

# A case begins with a command or one of these, whose options give way to those of the case.
BASES = {
    "LOOP": "loop --hurst 0.8 --n0 2 --ratio 4",
    "WAVE": f"loop --heights wave.csv {' '.join(map(str, OF_WAVE))} --load-steps 2"
    " --max-penetration 0.5",
    "TRACE": "trace t.txt --work-of-adhesion 0.04 --young 1e6 --poisson 0.5",
    "BENCH": "bench --quick",
}
# Of {a,b} each is tried, and {} is the one that is. Indented lines go on.
REFUSED = rf"""
# files to start from
new my.txt -> FILE.toml is my.txt: the name must end in .toml
new c.toml -> FILE.toml is c.toml, which exists: give another name
new none/my.toml -> FILE.toml is none/my.toml: there is no directory none
sample text -> FILE is text, which exists
# campaigns
run '' -> CAMPAIGN.toml is ''
run text -> is not valid TOML
run c.toml --out new.txt -> the name of a new results file must end in .h5
run c.toml --out c.toml -> the campaign file itself
run c.toml --out text -> text is not a results file of adhesis
run c.toml --ranks 100000 -> at most {16 * launch.cores()} are started here
run c.toml --ranks {{x,0,-1,nan}} -> --ranks is '{{}}'
run c.toml --walltime {{x,m,0,-1,nan,1e99,1000000000,1:2:3:4}} -> --walltime is '{{}}': it must
run c.toml --max-failures {{x,-1,nan,1e99,inf}} -> --max-failures is '{{}}'
run c.toml --patience {{x,-1,nan,1e99,inf}} -> --patience is '{{}}'
run c.toml --out p.h5 --part {{x,0/3,4/3,1/0}} -> --part is '{{}}': it must be K/N
run c.toml --part 1/2 -> --part needs --out
run c.toml {{--patience=0,--dry-run}} --out p.h5 --part 9/9 -> --part is 9/9: of 8 tasks in all
run stop.toml {{--patience=0,--dry-run}} --out p.h5 --part 1/2 -> its batches are decided on whole
run c.toml --redo some -> --redo is 'some'
run c.toml --dry-run --redo all -> --redo and --dry-run cannot be given together
run c.toml --hurst 0.7 -> --hurst needs --redo: it chooses the tasks to compute again
run c.toml --redo all --hurst {{x,-1,nan}} -> --hurst is '{{}}'
run c.toml --out r.h5 --redo failed --hurst 0.70000000001 ->
    --hurst is 0.70000000001: this campaign has no such task, only 0.7, 0.8
run c.toml --out none.h5 --redo all -> --redo computes again what is in a results file, and none.h5
run c.toml --out r.h5 --redo all --work-of-adhesion 4 -> only 0.01, 0.04
status {{text,empty.h5,other.h5}} -> is not a results file
status none.h5 -> does not exist
status directory -> is a directory, not a file
status r.h5 --interval {{x,-1,0,nan,inf,1e9}} -> --interval is '{{}}'
status r.h5 --watch --json -> --watch and --json
merge r.h5 -> required: --out
merge text --out all.h5 -> is not a results file
merge r.h5 --out none/all.h5 -> no folder
report text --to out -> is not a results file
report r/curves.nc --to r -> curves.nc would be written there over r/curves.nc
# tools
validate --method magic -> method is 'magic': it must be one of grid, sharp
BENCH --budget 0 -> --budget is '0': it must be a positive number of seconds
BENCH --to /proc/x -> --to is /proc/x: it cannot be written
doctor --in none -> --in is none: it must be a folder that can be written
# options of any command
LOOP {{--young,--measure,--seed,--json,--path}}=-- -> {{}} is '--'
LOOP --seed 1 --seed={{1,2}} -> --seed is given twice: give it once
# the profile and the material of a loop
loop -> no profile is given: give one of --hurst, --heights and --trace
LOOP --h-rms 1e-6 --m2 1e-3 -> --h-rms and --m2 are given: give one of
LOOP --method magic -> --method is 'magic': it must be one of grid
LOOP --unit um -> --unit belongs to --trace
LOOP --layer 0 -> --layer is 0.0: it must be a positive number
LOOP --layer 1e-3 --stiffness 1 -> --layer are given: give one of them
LOOP --work-of-adhesion-open 0.08 --method grid -> --method is 'grid' beside a work
{{LOOP,TRACE --plan --unit um}} --stripes 2 -> --stripe-amplitude is missing: give the
LOOP --stripes 2 --stripe-amplitude 0.1 --strength 1e8 -> is given beside a strength
loop --heights none.npy --period 1e-3 -> --work-of-adhesion, --young, --poisson are missing: with
loop --heights wave.csv --work-of-adhesion 0.01 --young 1e6 --poisson 0.5 ->
    --heights needs --period
WAVE --heights nan.npy -> has no finite height at index 1: --heights needs every
WAVE --heights scalar.npy -> heights hold 1 value(s): at least 3 are needed
WAVE --heights grid.npy -> holds 4 × 4 numbers: --heights takes one column
WAVE --heights {{text,complex}}.npy -> heights are real numbers
WAVE --heights object.npy -> is no .npy of numbers
WAVE --heights ragged.csv -> at least 3 of one length are needed
WAVE --hurst 0.8 -> --hurst and --heights are given: give one of them
WAVE --seed 4 -> --seed belongs to --hurst
WAVE --delimiter : -> --delimiter is ':': it must be one of
{{WAVE,TRACE --plan --unit um}} --measure projected -> --measure is 'projected': it must be one of
# the path of a loop
LOOP --young -1MPa -> --young: a value is missing; one that begins with - follows a =, as in
LOOP --path=-0.5,out -> it must start with loading
LOOP --path=out -> --path is 'out': it holds no turning point
LOOP --path=0.5,x,out -> --path is '0.5,x,out': it must be numbers with commas
LOOP --path=0.5,nan -> --path[1] is nan
{{LOOP,TRACE --plan --unit um}} --adhesion-range 0.3 -> --adhesion-range is 0.3 m, strength
LOOP --path=0.5 --max-penetration 0.5 -> are given: give one of them
LOOP --path 0,5,0,2,out -> --path is '0,5,0,2,out': numbers have a decimal point, as in
LOOP --max-penetration 90% -> --max-penetration is '90%': it must be one or more numbers between
LOOP --max-penetration 0.5,0.5 -> turning points must differ
LOOP --max-penetration {{0\,5,0\,3\,0\,6}} ->
    --max-penetration is '{{}}': numbers have a decimal point
LOOP --stiffness 0 -> needs --max-stress
LOOP --stiffness 0 --max-stress 2,5kPa ->
    as in 2.5kPa; if two are meant, write 2.0kPa,5.0kPa
LOOP --preload 2kPa,4 -> --preload is '2kPa,4': give each of the numbers its unit
LOOP --hurst 0,8 -> --hurst is '0,8': it must be a number, as in 0.5
LOOP --max-stress 20kPa -> a weight or a machine? For a weight give --stiffness 0 with
LOOP --max-stress 20kPa --stiffness 1e9 -> give --preload 20kPa instead
LOOP --preload 20kPa --stiffness 0 -> For a weight give --max-stress 20kPa with
LOOP --preload 20kPa --max-stress 1 -> --max-stress and --preload are given
LOOP --preload 20kPa --max-penetration 0.5,0.6 -> beside --preload: it must be one
LOOP --preload 20bar -> --preload is '20bar': its unit must be one of Pa, kPa
LOOP --stiffness 0 --max-stress 0.2kPa,5bar -> --max-stress is '5bar': its unit must be one of Pa
LOOP --preload 20kPa,20000Pa -> --preload is 20kPa,20000Pa: turning points must differ
# outputs of a loop
LOOP --figure loop.bmp -> --figure is loop.bmp: the name must end in .png
LOOP --film a.avi -> --film is a.avi: the name must end in .html, .gif or .mp4
LOOP --film no/a.html -> --film is no/a.html: there is no directory no
LOOP --film a.html --max-penetration 0.5,0.6 -> --film is given with 2 turning
LOOP --film a.html --json a.html -> --json and --film are both a.html
LOOP --path 0.5,out --fields f.npz -> --fields belongs to one loop
LOOP --fields f.txt -> must end in .npz
LOOP --fields f.npz --nodes-per-wave 16 --field-nodes 9 -> 9 nodes are too few: the shortest wave
WAVE --fields f.npz --field-nodes 1000000000000 ->
    --field-nodes is 1000000000000: with the fields of 8 states it must be at most 8388608
WAVE --fields f.npz --field-penetrations 0.2 0.6 -> holds 0.6: the loop goes no deeper than 0.5
LOOP --fields f.npz --field-penetrations 0,5 -> --field-penetrations is '0,5': it must be a
LOOP --field-penetrations 0.5 -> --field-penetrations needs --fields, the file
LOOP --preload 1 --fields f.npz --field-penetrations 0.1 ->
    give --field-stresses, as 5kPa 10kPa, instead
WAVE --json {{wave.csv,sub/../wave.csv,soft.csv,hard.csv}} ->
    --json is {{}}, the file that --heights reads: it would be overwritten, so give another file
WAVE --json 'a{chr(0)}b' -> --json is 'a\x00b': it must be the name of a file
WAVE --json wave.csv/o.json -> there is no directory
WAVE --json {300 * "x"} -> it cannot be written (File name too long)
WAVE --figure /proc/f.png -> --figure is /proc/f.png: it cannot be written
# traces
trace t.txt -> required: --work-of-adhesion, --young, --poisson
TRACE -> --to is missing: give the directory for the page, or --plan
TRACE --plan -> states no unit
TRACE --plan --unit um --columns 3 -> --columns is 3: it must name two of the 2
TRACE --plan --unit um --columns 2 -> no step with its unit is found in its header: give
TRACE --plan --unit um --columns x -> --columns is 'x': it must be one or two
TRACE --plan --unit um --tip-radius 5m -> trusted from 50 µm on (what a tip of
TRACE --plan --unit um --max-stress 5 -> a weight or a machine?
TRACE --plan --unit um --stiffness 0 -> (--stiffness 0) needs --max-stress
TRACE --plan --unit um --max-penetration 0 -> --max-penetration is 0.0: it must be a positive
TRACE --plan --unit um --max-penetration deep -> --max-penetration is 'deep'
TRACE --plan --unit um --step 1um -> --step belongs to heights without
TRACE --plan --unit um --processes 0 -> --processes is 0
TRACE --plan --work-of-adhesion {{0\,04,0.02\,0\,04,2\,5mJ/m2}} ->
    --work-of-adhesion is '{{}}': numbers have a decimal point, as in
TRACE --plan --work-of-adhesion 1.0,1.0 -> is [1.0, 1.0]: its values must
TRACE --plan --unit um --work-of-adhesion inf -> work-of-adhesion is inf: it must be 0 or a positive
TRACE --plan --work-of-adhesion 20mJ -> --work-of-adhesion is '20mJ': it must be a number in J/m²
TRACE --plan --unit um --exclude 0.1:0.2:0.3mm -> it must be two positions with a colon
TRACE --plan --unit um --exclude 200:300um ->
    a position of it is 200, which would be 200 m: give its unit
TRACE --plan --unit um --exclude 0.3mm:0.2mm ->
    --exclude holds the range from 300 µm to 200 µm: a range must begin
TRACE --unit um --to out --work-of-adhesion 0.04,0.02 --work-of-adhesion-open 0.1 ->
    beside 2 works of adhesion: give one of
TRACE --unit um --to out --work-of-adhesion-open 0.08 --method grid -> --method is 'grid' besi
loop --trace t.txt --work-of-adhesion 1 --young 1e6 --poisson 0.5 --period 2mm ->
    --period belongs to --hurst and --heights
trace ow/trace.md --work-of-adhesion 1 --young 1e6 --poisson 0.5 --unit um --to ow ->
    --to is ow: trace.md would be written there over ow/trace.md, the file that the command reads
trace ow/trace.md --work-of-adhesion 1 --young 1e6 --poisson 0.5 --unit um --to linked ->
    --to is linked: trace.md would
TRACE --unit um --to {{text,text/x}} -> text is not a directory
TRACE --unit um --to way -> trace.html is to be written there
"""


def cases() -> list[Any]:
    found = []
    for line in re.sub(r"->\n +", "-> ", REFUSED).split("\n"):
        if not line or line.startswith("#"):
            continue
        text, sentence = line.split("-> ", 1)
        braces = re.search(r"\{(.*?)\}", text)
        several = re.split(r"(?<!\\),", braces[1]) if braces else [""]
        for one in (value.replace("\\,", ",") for value in several):
            command, *more = shlex.split(text.replace(braces[0], one) if braces else text)
            words = replacing(shlex.split(BASES.get(command, command)), more)
            name = " ".join(words)[:80].replace("\0", "NUL")
            found.append(pytest.param(words, sentence.replace("{}", one), id=name))
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The current folder, with what the cases name, in which no work begins."""
    folder = tmp_path_factory.mktemp("refused")
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.chdir(folder)
        fill(folder)
        forbid_work(monkeypatch)
        yield folder


ARRAYS = {
    "nan": [1.0, np.nan, 2.0, 3.0],
    "scalar": 1.0,
    "grid": np.ones((4, 4)),
    "text": np.array(["a", "b", "c"]),
    "complex": np.ones(4) * 1j,
    "object": np.array([{}, 1, 2], dtype=object),
}


def fill(folder: Path) -> None:
    create(folder / "r.h5", load_campaign(write_campaign(folder)))
    Path("stop.toml").write_text(campaign_text() + "[stop]\nrelative_error = 0.1\nmost = 40\n")
    for name in ("directory", "sub", "ow", "r", "way/trace.html"):
        Path(name).mkdir(parents=True)
    Path("text").write_text("notes")
    for name in ("r/curves.nc", "empty.h5"):
        Path(name).touch()
    with h5py.File("other.h5", "w") as file:
        file["x"] = 1
    Path("wave.csv").write_text("\n".join(map(repr, WAVE_HEIGHTS.tolist())))
    os.link("wave.csv", "hard.csv")
    Path("ragged.csv").write_text("1;2\n1\n3;4;5\n")
    for name, array in ARRAYS.items():
        np.save(f"{name}.npy", np.asarray(array))
    x = np.arange(200)
    lines = [f"{a / 2} {np.cos(a / 3) + 0.3 * np.sin(a):.4f}" for a in x]
    for name in ("t.txt", "ow/trace.md"):
        Path(name).write_text("\n".join(lines))
    for link, target in {"soft.csv": "wave.csv", "there.json": "there.png", "linked": "ow"}.items():
        Path(link).symlink_to(target)


def content(folder: Path) -> dict[str, bytes | None]:
    """Return the files of a folder and what they hold, but for locks."""
    files = (path for path in folder.rglob("*") if path.suffix != ".lock")
    return {str(path): path.read_bytes() if path.is_file() else None for path in files}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("words", "sentence"), cases())
def test_bad_words_are_one_sentence(words, sentence, folder, capsys):
    before = content(folder)
    assert main(words) == 2
    printed = capsys.readouterr()
    (line,) = printed.err.splitlines()
    assert printed.out == ""
    assert line.startswith(f"adhesis {words[0]}: ")
    assert sentence in line
    assert content(folder) == before
