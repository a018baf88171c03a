"""Documentation that runs: code, commands, links and images of README and docs/; examples."""

import re
import runpy
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
from markdown_it import MarkdownIt
from PIL import Image

from adhesis.ensemble import exit_codes
from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.command.main import COMMANDS, main, parser_of
from tests.support.campaign_support import ROOT
from tests.support.fake_run import run_file
from tools import commands as commands_page
from tools import transcripts

PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *(p for p in sorted(ROOT.glob("docs/**/*.md")) if "_build" not in p.parts),
    *sorted(ROOT.glob("study/**/*.md")),
]

EXAMPLES = sorted((ROOT / "examples").glob("[0-9]_*.py"))

# Commands of which every one is run; the others are read by their parser alone, and have tests of
# their own.
RUN = ("loop", "new", "sample", "status")
PROGRAMS = (
    *(".", "adhesis", ".venv/bin/adhesis", "make", "mpirun", "sbatch", "qsub", "export"),
    *("python", "python3", ".venv/bin/pip"),
)


@dataclass(frozen=True)
class Block:
    """A code block of a page, fenced or indented."""

    page: Path
    language: str
    text: str

    @property
    def name(self) -> str:
        return f"{self.page.relative_to(ROOT)}: {self.text.splitlines()[0][:60]}"


def blocks(page: Path) -> Iterator[Block]:
    """Every block, in order; paragraphs of an indented block are blocks of their own."""
    for token in MarkdownIt("commonmark").disable("inline").parse(page.read_text()):
        if token.type == "fence":
            yield Block(page, token.info, token.content)
        elif token.type == "code_block":
            for text in token.content.split("\n\n"):
                yield Block(page, "", text.strip("\n") + "\n")


def is_of_commands(block: Block) -> bool:
    """Whether the block holds commands, and not a formula or what they print."""
    program = block.text.split()[0]
    is_known = program in PROGRAMS or re.fullmatch(r"(PATH/)?jobs/\w+\.sh", program) is not None
    marked = ("bash", "sh") if not is_known else ("", "bash", "sh")
    return block.language in marked and not is_transcript(block)


def is_transcript(block: Block) -> bool:
    return block.language in ("console", "pycon") or block.text.startswith("$ ")


BLOCKS = [block for page in PAGES for block in blocks(page)]
# Pages whose blocks run one after the other in one folder, and show what they print.
LESSONS = sorted({block.page for block in BLOCKS if is_transcript(block)})


def commands(block: Block) -> list[str]:
    """The lines of a block of commands, without their comments; a backslash joins two lines."""
    joined = re.sub(r" \\\n\s*", " ", block.text)
    return [re.sub(r"\s+# .*", "", line) for line in joined.splitlines()]


LINES = [(block, line) for block in BLOCKS if is_of_commands(block) for line in commands(block)]


@pytest.mark.parametrize(
    "block",
    [b for b in BLOCKS if b.language == "python" and b.page not in LESSONS],
    ids=lambda block: block.name,
)
@pytest.mark.usefixtures("quick_figures")
def test_python_runs(block, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(block.text, block.name, "exec"), {"__name__": "__main__"})
    shown = capsys.readouterr().out
    assert shown
    if block.page.name == "README.md":
        match = re.fullmatch(r"([\d.]+) J/m² lost in (\d+) jumps \(([\d.]+) J/m²\)\n", shown)
        assert match is not None, shown
        assert float(match[1]) > 0
        assert abs(float(match[1]) / float(match[3]) - 1) < 0.01


@pytest.mark.parametrize(
    "block", [b for b in BLOCKS if b.language == "toml"], ids=lambda block: block.name
)
def test_campaigns_are_valid(block: Block) -> None:
    assert parse_campaign(block.text).tasks()


def example() -> str:
    block = next(b for b in BLOCKS if b.language == "toml" and b.page.name == "campaign-file.md")
    return block.text


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the commands run: with the files that they name."""
    folder = tmp_path_factory.mktemp("docs")
    (folder / "my.toml").write_text(example())
    heights = "\n".join(f"{1e-6 * (-1) ** k / (1 + k % 7)}" for k in range(31))
    (folder / "heights.csv").write_text(heights)
    assert run_file(folder / "my.toml", folder / "my.h5").failed == 0
    assert main(["sample", str(folder / "trace.csv")]) == 0
    return folder


def adhesis_words(line: str) -> list[str] | None:
    """Return what stands after ``adhesis`` in a command, also in one that a launcher starts."""
    words = shlex.split(line)
    for place, word in enumerate(words):
        if " " in word:  # sbatch --wrap "…"
            return adhesis_words(word)
        if word in ("adhesis", ".venv/bin/adhesis"):
            return words[place + 1 :]
    return None


def is_run(line: str) -> bool:
    words = adhesis_words(line)
    return words is not None and (words[0] in RUN or "--plan" in words)


@pytest.mark.parametrize(("block", "line"), LINES, ids=[line for _, line in LINES])
def test_commands_are_understood(block: Block, line: str) -> None:
    words = adhesis_words(line)
    if words is not None:
        parser_of(words[0]).parse_args(words[1:])  # ends the test with a message if it cannot
    for path in re.findall(r"\b((?:jobs|examples)/[\w/-]+\.\w+)", line):
        assert (ROOT / path).exists()
    if line.startswith("make "):
        assert re.search(rf"^{line.split()[1]}:", (ROOT / "Makefile").read_text(), re.MULTILINE)


@pytest.mark.parametrize("line", sorted({line for _, line in LINES if is_run(line)}))
def test_commands_run(line, folder, tmp_path, monkeypatch):
    words = adhesis_words(line)
    assert words is not None
    writes_new = words[0] in ("new", "sample")  # which refuse a file that is there
    monkeypatch.chdir(tmp_path if writes_new else folder)
    assert main(words) == 0


@pytest.mark.usefixtures("quick_figures")
@pytest.mark.parametrize("page", LESSONS, ids=lambda page: str(page.relative_to(ROOT)))
def test_lessons_print_what_their_pages_show(page, tmp_path, monkeypatch):
    wrong = re.sub(r"hurst = .*", "hurst = [0.8, 1.2]", example())
    (tmp_path / "wrong.toml").write_text(wrong)
    monkeypatch.chdir(tmp_path)
    pieces = list(transcripts.pieces(page.read_text()))
    shown = sum(is_transcript(block) for block in BLOCKS if block.page == page)
    assert len([p for p in pieces if p.kind in ("command", "session")]) >= shown
    assert transcripts.wrong(page, transcripts.lesson(page)) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_in_the_text_exist(page: Path) -> None:
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    for snippet in re.findall(r"`([^`]+)`", text):
        words = snippet.replace("[", " ").replace("]", " ").split()
        if "adhesis" in words[:-1]:
            name, *rest = words[words.index("adhesis") + 1 :]
            if name in ("COMMAND", "--version", "--help", "…"):
                continue
            assert name in COMMANDS, snippet
            known = parser_of(name)._option_string_actions
            for option in (word for word in rest if word.startswith("--")):
                assert option in known, snippet
        if snippet.startswith("make "):
            assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(), re.MULTILINE)
        for path in re.findall(r"^(?:(?:jobs|docs|tests|tools|solver|examples)/[\w/.-]+)", snippet):
            assert (ROOT / path).exists(), snippet


def test_the_reference_of_commands_is_that_of_the_parsers() -> None:
    """``python -m tools.commands`` writes it anew."""
    text = commands_page.PAGE.read_text()
    assert re.findall(r"^## adhesis (\w+)$", text, re.MULTILINE) == list(COMMANDS)
    assert text == commands_page.page(text)


def test_exit_codes_of_the_page_are_those_of_the_commands() -> None:
    page = (ROOT / "docs" / "troubleshooting.md").read_text()
    listed = {int(code) for code in re.findall(r"^\| (\d+) \|", page, re.MULTILINE)}
    assert listed == {int(code) for name, code in vars(exit_codes).items() if name.isupper()}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run(path, monkeypatch, capsys):
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    monkeypatch.setattr(plt, "show", lambda: None)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    runpy.run_path(str(path))
    figures = plt.get_fignums()
    plt.close("all")
    assert figures
    assert capsys.readouterr().out


@cache
def is_picture(path: Path) -> bool:
    with Image.open(path) as image:
        image.verify()
        return image.size[1] > 100


@cache
def headings(page: Path) -> set[str]:
    """Anchors of the headings of a page, as GitHub makes them."""
    found: set[str] = set()
    for text in re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE):
        anchor = re.sub(r"[^\w\- ]", "", text).strip().lower().replace(" ", "-")
        again = sum(bool(re.fullmatch(rf"{anchor}(-\d+)?", other)) for other in found)
        found.add(f"{anchor}-{again}" if again else anchor)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_images_are_there(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if re.match(r"https?:", target):
            continue
        name, _, anchor = target.partition("#")
        path = (page.parent / name) if name else page
        assert path.exists(), target
        if anchor:
            assert anchor in headings(path), target
        if path.suffix == ".png":
            assert is_picture(path), target
