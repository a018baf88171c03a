"""The commands that write files to start from: a campaign, a sample trace, a shell's completion."""

import dataclasses
import hashlib
import re
import shlex
from pathlib import Path

import pytest

from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.campaign.tables import TABLES
from adhesis.ensemble.command.main import COMMANDS, main, parser_of
from adhesis.ensemble.command.new import KEY_EXAMPLES, campaign_template
from adhesis.ensemble.report.figures.catalogue import ALL
from adhesis.ensemble.trace.reading.measured_trace import read_trace
from tests.support.campaign_support import ROOT, run_python
from tests.support.processes import ran

KEYS = [(name, entry.name) for name, table in TABLES.items() for entry in dataclasses.fields(table)]


def listed(text: str) -> list[tuple[str, str]]:
    """Return table and key of every line of a campaign file, in a comment or not."""
    table, found = "", []
    for line in text.splitlines():
        if head := re.match(r"(?:# )?\[(\w+)\]", line):
            table = head[1]
        elif key := re.match(r"(?:# )?(\w+) = ", line):
            found.append((table, key[1]))
    return found


def test_templates_and_captions_are_those_without_docstrings_too() -> None:
    code = (
        "from adhesis.ensemble.command.new import campaign_template\n"
        "from adhesis.ensemble.report.figures.catalogue import ALL\n"
        "print(campaign_template(), [(item.title, item.caption) for item in ALL])"
    )
    plain = f"{campaign_template()} {[(item.title, item.caption) for item in ALL]}\n"
    assert "A caret at 0 marks an interval" in plain
    assert run_python("-OO", "-c", code).stdout == plain


def test_a_new_campaign_lists_every_key_of_the_page() -> None:
    page = (ROOT / "docs" / "campaign-file.md").read_text()
    described = []
    for name in TABLES:
        section = page.split(f"## `[{name}]`")[1].split("\n## ")[0]
        described += [(name, key) for key in re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)]
    assert listed(campaign_template()) == described == KEYS
    assert all(len(line) <= 100 for line in campaign_template().splitlines())


@pytest.mark.parametrize(("table", "key"), KEYS)
def test_a_key_in_a_comment_shows_its_default_or_a_value_that_is_allowed(table, key):
    text = campaign_template()
    line = next(
        line
        for line in re.split(rf"(?m)^(?:# )?\[{table}\]", text)[1].splitlines()
        if re.match(rf"(# )?{key} = ", line)
    )
    if not line.startswith("# "):
        return
    (entry,) = (entry for entry in dataclasses.fields(TABLES[table]) if entry.name == key)
    text = text.replace(line, line[2:])
    if table == "stop":
        text = text.replace("# [stop]", "[stop]").replace("# relative_error", "relative_error")
    if key in ("stripes", "stripe_amplitude"):  # which belong together
        text = re.sub("(?m)^# (stripes|stripe_amplitude) =", r"\1 =", text)
    if key in ("m2", "c0"):
        text = text.replace("\nh_rms", "\n# h_rms")
    if key == "max_stress":
        text = text.replace("\nmax_penetration", "\n# max_penetration")
        text = text.replace('# control = "separation"', 'control = "load"')
    value = getattr(getattr(parse_campaign(text), table), key)
    if f"{table}.{key}" in KEY_EXAMPLES:
        assert entry.default is None
        assert value is not None
        assert "# example; left out by default" in line
    else:
        assert value == entry.default


# The same on every machine.
SAMPLE = "ee3eef042a9a60b37058b75ada90394d5b83ad112bde53187398f61592cdd5e7"


def test_the_sample_is_a_trace_and_the_same_everywhere(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["sample", "my trace.csv"]) == 0
    shown = capsys.readouterr().out
    assert hashlib.sha256(Path("my trace.csv").read_bytes()).hexdigest() == SAMPLE
    trace = read_trace("my trace.csv")
    assert (trace.points, trace.drop_outs) == (1001, 4)
    assert trace.length == pytest.approx(1e-3)
    following = re.search(r"^next        adhesis (.*)$", shown, re.MULTILINE)
    assert following is not None
    assert main([*shlex.split(following[1]), "--plan"]) == 0
    assert "form        tilt and bow subtracted" in capsys.readouterr().out


def completed(script: str, *words: str) -> set[str]:
    """Return what bash would offer for the last word."""
    code = (
        f"{script}\nCOMP_WORDS=({' '.join(map(repr, words))})\n"
        f"COMP_CWORD={len(words) - 1}\n_adhesis\nprintf '%s\\n' \"${{COMPREPLY[@]}}\""
    )
    done = ran("bash", "--norc", "-c", code, check=True)
    assert done.stderr == ""
    return set(done.stdout.split())


def test_a_shell_completes_commands_options_and_shells(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    assert completed(script, "adhesis", "") == {*COMMANDS, "--help", "--version"}
    assert completed(script, "adhesis", "me") == {"merge"}
    options = set(parser_of("loop")._option_string_actions)
    assert completed(script, "adhesis", "loop", "--hurst", "0.8", "-") == options
    assert completed(script, "adhesis", "loop", "--max-p") == {"--max-penetration"}
    assert completed(script, "adhesis", "completion", "") == {"bash", "zsh"}
    assert completed(script, "adhesis", "run", "") == set()  # files, by the shell's own rule
    assert completed(script, "adhesis", "nothing", "-") == set()
    assert main(["completion", "zsh"]) == 0
    assert capsys.readouterr().out == f"autoload -U +X bashcompinit && bashcompinit\n{script}"
