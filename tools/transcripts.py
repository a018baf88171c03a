"""Run the lessons of a page: its Python blocks and its commands, and compare what they print.

    python -m tools.transcripts docs/tutorial.md     runs the page, and shows what differs
    python -m tools.transcripts --renew docs/*.md    writes what is printed now into the pages

The blocks of a page run one after the other in one folder:

- commands, after ``$ ``, with what they print;
- Python (``python``), and Python with its answers (``pycon``);
- files: a ``toml`` block whose first line is ``# NAME.toml`` is saved under that name.

A line ``…`` stands for any lines that are left out.
"""

import argparse
import contextlib
import io
import re
import shlex
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

_NUMBER = r"(?<![\w.])[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\d)"
# Numbers that differ from run to run: they are not compared.
_MEASURED = rf"(?:{_NUMBER} (?:s|min|h|MB|kB|core hours?)\b ?)+|\d\d:\d\d:\d\d"
# Estimated errors: small differences of large numbers, in which the last bits show.
_ESTIMATE = rf"(?:(?<=residual )|(?<=\nerror       )){_NUMBER}"
_TOKEN = re.compile(
    rf"(?P<lines>^ *…\n)|(?P<bit>…)|(?P<measured>{_MEASURED})|(?P<estimate>{_ESTIMATE})|{_NUMBER}",
    re.MULTILINE,
)
# Lines that report progress: how many there are depends on the machine.
_PROGRESS = re.compile(r"^((un)?loading( +(Δ/h_max|p̄) .*)?|frames( .*)?)\n", re.MULTILINE)


@dataclass(frozen=True)
class Piece:
    """A piece of a lesson: what is typed, what is shown for it, and where that stands."""

    kind: str  # "command", "python", "session" or "file"
    typed: str
    shown: str = ""  # output as the page has it; none for Python without answers and for files
    start: int = 0  # place of ``shown`` in the text of the page
    end: int = 0


def pieces(text: str) -> Iterator[Piece]:
    """Find what a page runs, in order."""
    fences = r"^```(?P<language>console|python|pycon|toml)\n(?P<fenced>.*?)^```$"
    for found in re.finditer(fences, text, re.MULTILINE | re.DOTALL):
        language = found["language"]
        if language in ("python", "toml"):
            yield Piece("python" if language == "python" else "file", found["fenced"])
            continue
        if language == "pycon":
            kind, prompt, typed = "session", r">>> ", r">>> .*\n(?:\.\.\.(?: .*)?\n)*"
        else:
            kind, prompt, typed = "command", r"\$ ", r"\$ (?:.*\\\n)*.*\n"
        answers = re.compile(rf"^(?P<typed>{typed})(?P<shown>(?:(?!{prompt}).*\n)*)", re.MULTILINE)
        for answer in answers.finditer(found["fenced"]):
            start, end = (found.start("fenced") + place for place in answer.span("shown"))
            words = re.sub(r"^(\$|>>>|\.\.\.) ?", "", answer["typed"], flags=re.MULTILINE)
            yield Piece(kind, words, answer["shown"], start, end)


def run(piece: Piece, names: dict[str, object]) -> str:
    """Run a piece in the working directory; returns what it prints, stdout before stderr.

    ``names`` are those of the Python session, kept from piece to piece.
    """
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        if piece.kind == "command":
            _run_command(piece.typed)
        elif piece.kind == "file":
            name = re.match(r"# (\w+\.toml)\n", piece.typed)
            if name is not None:
                Path(name[1]).write_text(piece.typed, encoding="utf-8")
        else:
            mode = "exec" if piece.kind == "python" else "single"
            exec(compile(piece.typed, "page", mode), names)
    return _PROGRESS.sub("", out.getvalue() + err.getvalue())


def _run_command(typed: str) -> None:
    words = shlex.split(typed.replace("\\\n", " "))
    if words[:2] == ["head", "-n"]:
        lines = Path(words[3]).read_text(encoding="utf-8").splitlines()
        print(*lines[: int(words[2])], sep="\n")
    elif words[0] == "adhesis":
        from adhesis.ensemble.command.main import main as adhesis

        adhesis(words[1:])
    else:
        raise ValueError(f"{words[0]} is no command that is run here")


def differences(shown: str, printed: str) -> list[str]:
    """Compare an output with the one that a page shows; returns what differs, in sentences.

    Texts and whole numbers have to be equal. Other numbers may differ by one unit of the last
    place, since the last bits depend on the processor, and estimated errors by a factor of three.
    Times and sizes are not compared.
    """
    pattern, wanted = _pattern(shown)
    found = re.fullmatch(pattern, printed)
    if found is None:
        return [f"shown:\n{shown}printed:\n{printed}"]
    return [
        f"{old} is shown, {new} is printed"
        for (old, is_estimate), new in zip(wanted, found.groups(), strict=True)
        if not _close(old, new, is_estimate)
    ]


def _pattern(shown: str) -> tuple[str, list[tuple[str, bool]]]:
    """Return the pattern of an output, a group for each number, and these numbers.

    With each number stands whether it is an estimate.
    """
    parts, wanted, last = [], [], 0
    for found in _TOKEN.finditer(shown):
        parts.append(re.escape(shown[last : found.start()]))
        last = found.end()
        if found["lines"]:
            parts.append(r"(?:[^\n]*\n)*?")
        elif found["bit"]:
            parts.append(r"[^\n]*?")
        elif found["measured"]:
            parts.append(rf"(?:{_MEASURED})")
        else:
            parts.append(f"({_NUMBER})")
            wanted.append((found[0], found["estimate"] is not None))
    parts.append(re.escape(shown[last:]))
    # The width of a column depends on the numbers in it.
    return re.sub(r"(\\ ){2,}", r"\\ +", "".join(parts)), wanted


def _close(old: str, new: str, is_estimate: bool) -> bool:
    a, b = (float(text.replace(",", "")) for text in (old, new))
    if is_estimate:
        return a == b or (a * b > 0 and 1 / 3 < a / b < 3)
    mantissa, _, exponent = old.partition("e")
    places = len(mantissa.partition(".")[2])
    whole = not places and not exponent
    return a == b if whole else abs(a - b) < 1.01 * 10.0 ** (int(exponent or 0) - places)


def lesson(page: Path) -> list[tuple[Piece, str]]:
    """Run a page in the working directory; returns each piece with what it prints."""
    names: dict[str, object] = {}
    return [(piece, run(piece, names)) for piece in pieces(page.read_text(encoding="utf-8"))]


def renewed(page: Path, run_pieces: list[tuple[Piece, str]]) -> str:
    """Return the page with the outputs of a run; those with lines left out stay as they are."""
    text = page.read_text(encoding="utf-8")
    for piece, printed in reversed(run_pieces):
        if piece.kind in ("python", "file") or "…" in piece.shown:
            continue
        text = text[: piece.start] + printed + text[piece.end :]
    return text


def wrong(page: Path, done: list[tuple[Piece, str]]) -> list[str]:
    """Return what a page shows otherwise than it was printed, in sentences."""
    return [
        f"{page.name}: {piece.typed.strip()}\n{sentence}"
        for piece, printed in done
        if piece.kind in ("command", "session")
        for sentence in differences(piece.shown, printed)
    ]


def main() -> int:
    """Run pages; returns 1 if one shows something else than is printed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0], allow_abbrev=False)
    parser.add_argument("pages", nargs="+", type=Path)
    parser.add_argument("--renew", action="store_true", help="write what is printed into the pages")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="for the files that a page writes")
    args = parser.parse_args()
    code = 0
    for page in [path.resolve() for path in args.pages]:
        with tempfile.TemporaryDirectory() as folder:
            with contextlib.chdir(folder):
                done = lesson(page)
            if args.keep is not None:
                shutil.copytree(folder, args.keep, dirs_exist_ok=True)
        if args.renew:
            page.write_text(renewed(page, done), encoding="utf-8")
            done = [(piece, printed) for piece, printed in done if "…" in piece.shown]
        for sentence in wrong(page, done):
            code = 1
            print(sentence)
    return code


if __name__ == "__main__":
    sys.exit(main())
