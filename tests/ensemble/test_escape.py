"""Texts from files are shown as texts; links in place of our own files are not followed."""

import h5py
import numpy as np
import pytest
import xarray
from markdown_it import MarkdownIt

import adhesis
from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.command.main import main
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.escape import code_span, markdown, one_line, printable, shell_word
from adhesis.ensemble.report.html import html_page
from adhesis.ensemble.results.layout import create
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.write import Writer
from adhesis.ensemble.run.lock import RunLock, described, holder
from adhesis.ensemble.run.session import run_campaign
from tests.support.campaign_support import campaign_text
from tests.support.fake_run import fake_engine, write_results

HOSTILE = [
    "![x](/etc/passwd)",
    "`![x](/etc/passwd)`",
    "``![x](/etc/passwd)",
    "[x](javascript:alert)",
    "<img src=/etc/passwd>",
    "a | b ** c ** &lt; \\",
    "first\n\n# second\r\n| a |\n|---|",
    "\x1b]0;title\x07\x1b[2J\x9b31m \u202e",
]


@pytest.mark.parametrize("text", HOSTILE)
@pytest.mark.parametrize("shown", [markdown, code_span])
def test_a_text_from_a_file_is_shown_letter_by_letter(text, shown):
    """No element but that of the code span comes out."""
    page = MarkdownIt("commonmark", {"html": False}).enable("table").render(f"- {shown(text)}")
    inside = page.replace("<ul>", "").replace("</ul>", "").replace("\n", "")
    inside = inside.removeprefix("<li>").removesuffix("</li>")
    inside = inside.removeprefix("<code>").removesuffix("</code>")
    for char, entity in (("<", "&lt;"), (">", "&gt;"), ('"', "&quot;"), ("&", "&amp;")):
        assert char == "&" or char not in inside
        inside = inside.replace(entity, char)
    assert inside.strip() == one_line(text)


def test_control_characters_are_spelled_out_and_letters_stay():
    assert printable("γ = 0.04 J/m² – «ok»\n\tnext") == "γ = 0.04 J/m² – «ok»\n\tnext"
    assert [shell_word(name) for name in ("a b.h5", "-x.h5", "é.h5")] == [
        "'a b.h5'",
        "./-x.h5",
        "'é.h5'",
    ]
    assert printable("\x1b[31mred\x07 \x9b2J\r\u202e\udce9") == (
        r"\x1b[31mred\x07 \x9b2J\r\u202e\udce9"
    )
    assert str(InputError("column \x1b[31m")) == r"column \x1b[31m"


def test_status_prints_no_control_characters(tmp_path, capsys, monkeypatch):
    path = tmp_path / "r.h5"
    create(path, parse_campaign(campaign_text()))
    with Writer(path) as writer:
        writer.write_failure(0, "diverged \x1b]0;title\x07\nsecond line \x9b31m", 1.0)
    with RunLock(path) as lock:
        monkeypatch.setattr("socket.gethostname", lambda: "node\x1b[2J")
        lock.acquire(1, 0.0)
        assert described(holder(path)).startswith(r"host node\x1b[2J, process ")
    for words in ([], ["--json"]):
        assert main(["status", str(path), *words]) == 0
        shown = capsys.readouterr().out
        assert all(char == "\n" or char.isprintable() for char in shown)
        assert "diverged" in shown
        assert "second line" in shown


def test_a_merge_names_a_damaged_file_without_control_characters(tmp_path, capsys):
    part = tmp_path / "a\x1b[31m.h5"
    create(part, parse_campaign(campaign_text()))
    with Writer(part) as writer:
        writer.write_failure(0, "diverged", 1.0)
    with h5py.File(part, "r+") as file:
        file["wall_time"][0] = 2.0
    assert main(["merge", str(part), "--out", str(tmp_path / "all.h5")]) == 0
    errors = capsys.readouterr().err
    assert r"a\x1b[31m.h5 is damaged in row 0; damaged rows are not used" in errors
    assert "\x1b" not in errors


PNG = b"\x89PNG\r\n\x1a\n" + bytes(100)


def test_names_of_files_are_printed_without_control_characters(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    name = "a\x1b[31m\x07"
    contact = ["--work-of-adhesion", "0.04", "--young", "1e6", "--poisson", "0.5"]
    small = ["--hurst", "0.8", "--n0", "1", "--ratio", "2", "--load-steps", "2", "--quiet"]
    (tmp_path / f"{name}.txt").write_text("\n".join(str(1e-6 * (k % 3)) for k in range(7)))
    for words in (
        ["new", f"{name}.toml"],
        ["sample", f"{name}.csv"],
        ["trace", f"{name}.csv", *contact, "--plan"],
        ["loop", *small, "--json", f"{name}.json", "--csv", f"{name}2.csv"],
        ["loop", "--heights", f"{name}.txt", "--period", "1mm", *contact, "--load-steps", "1"],
    ):
        assert main(words) == 0
        shown = "".join(capsys.readouterr())
        assert r"a\x1b[31m\x07" in shown
        assert not {"\x1b", "\x07"} & set(shown)
    assert (tmp_path / f"{name}.json").exists()


@pytest.mark.usefixtures("no_figures")
def test_a_report_names_a_file_whose_name_is_no_utf_8(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    campaign = parse_campaign(campaign_text())
    for name in ("\udcff\x1b.h5", "other\udcff.h5"):
        create(name, campaign)
        write_results(tmp_path / name, campaign, range(8))
    assert main(["report", "\udcff\x1b.h5", "--to", "a\x1b", "--beside", "other\udcff.h5"]) == 0
    assert r"report: a\x1b/report.md" in capsys.readouterr().out
    assert r"`\udcff\x1b.h5`" in (tmp_path / "a\x1b" / "report.md").read_text().splitlines()[0]
    assert r"other\udcff.h5," in (tmp_path / "a\x1b" / "beside.csv").read_text()
    with xarray.open_dataset(tmp_path / "a\x1b" / "curves.nc", engine="h5netcdf") as curves:
        assert curves.attrs["source"] == adhesis.open("\udcff\x1b.h5").dataset.source


def test_images_come_from_the_folder_of_the_page_alone(tmp_path):
    report = tmp_path / "report"
    (report / "below").mkdir(parents=True)
    for path in (report / "own.png", report / "below" / "b.png", tmp_path / "outside.png"):
        path.write_bytes(PNG)
    (report / "secret.txt").write_text("no image")
    (report / "link.png").symlink_to(tmp_path / "outside.png")

    def shows(name: object) -> bool:
        return "data:image/png" in html_page(f"# Page\n\n![figure]({name})\n", report)

    assert shows("own.png")
    for name in (
        *(tmp_path / "outside.png", "../outside.png", "link.png", "secret.txt", "below/b.png"),
        *("/etc/passwd", "missing.png", "../report/below/../../outside.png"),
    ):
        assert not shows(name), name


def test_two_names_of_one_results_file_have_one_lock(tmp_path):
    real, link = tmp_path / "real.h5", tmp_path / "sym.h5"
    link.symlink_to(real)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "far.h5").symlink_to("../sym.h5")
    assert {RunLock(path).path for path in (real, link, tmp_path / "sub" / "far.h5")} == {
        tmp_path / "real.h5.lock"
    }


def test_a_run_through_a_link_makes_and_grows_the_file_that_it_leads_to(tmp_path):
    scratch, link = tmp_path / "scratch", tmp_path / "r.h5"
    scratch.mkdir()
    link.symlink_to("scratch/real.h5")
    for realisations in ("1", "2"):
        campaign = parse_campaign(campaign_text(realisations=realisations))
        run_campaign(campaign, link, engine=fake_engine(""))
        assert link.is_symlink()
        with Results(scratch / "real.h5") as file:
            assert len(file) == campaign.task_count
            assert np.all(file.status() == 1)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["r.h5", "real.h5", "scratch"]
