"""``adhesis loop`` with several turning points, any path, a stiffness or a load."""

from __future__ import annotations

import json

import pytest
from matplotlib.image import imread

from adhesis.ensemble.command.main import main
from tests.support.options import replacing

SCENE = [
    "loop", "--hurst", "0.8", "--seed", "4", "--period", "1e-3", "--n0", "3", "--ratio", "6",
    "--work-of-adhesion", "0.01", "--load-steps", "6", "--quiet",
]  # fmt: skip


def run(tmp_path, capsys, *words: str) -> tuple[dict, str]:
    out = tmp_path / "loop.json"
    assert main([*SCENE, *words, "--json", str(out)]) == 0
    return json.loads(out.read_text()), capsys.readouterr().out


def test_several_turning_points_are_turns_of_one_document(tmp_path, capsys):
    figure = tmp_path / "loops.png"
    document, _ = run(tmp_path, capsys, "--max-penetration", "0.6,0.3,0.8", "--figure", str(figure))
    assert [turn["max_penetration"] for turn in document["turns"]] == [0.3, 0.6, 0.8]
    losses = [turn["loss"] for turn in document["turns"]]
    assert losses == sorted(losses)
    assert document["loss"] == losses[-1]
    for turn in document["turns"]:
        assert turn["work_spent"] - turn["work_gained"] == pytest.approx(turn["loss"])
    assert imread(figure).ndim == 3
    alone, _ = run(tmp_path, capsys, "--max-penetration", "0.8")
    assert "turns" not in alone
    assert alone["loss"] == pytest.approx(losses[-1], rel=1e-4)


def test_a_path_tells_of_its_minor_loops(tmp_path, capsys):
    document, text = run(tmp_path, capsys, "--path", "0.8,0.3,0.6,out")
    (minor,) = document["minor_loops"]
    assert (minor["start"], minor["turn"]) == (0.3, 0.6)
    assert document["out"]
    assert set(document["leg"]) == {0, 1, 2, 3}
    assert "minor loop  0.3, 0.6, 0.3:" in text
    stays, _ = run(tmp_path, capsys, "--path", "0.8,0.3")
    assert not stays["out"]
    assert stays["energy_change"] < 0


def test_a_stiffness_and_a_load(tmp_path, capsys):
    fixed, _ = run(tmp_path, capsys, "--max-penetration", "0.5")
    soft, text = run(tmp_path, capsys, "--max-penetration", "0.5", "--stiffness", "1e9")
    assert fixed["stiffness"] is None
    assert soft["stiffness"] == 1e9
    assert soft["loss"] > fixed["loss"]
    assert max(soft["displacement"]) == pytest.approx(0.5)
    assert "held by 1e+09 Pa/m" in text
    load, _ = run(tmp_path, capsys, "--stiffness", "0", "--max-stress", "500")
    assert max(load["mean_stress"]) == pytest.approx(500)
    layer, _ = run(
        tmp_path, capsys, "--max-penetration", "0.5", "--poisson", "0.3", "--layer", "1e-3"
    )
    assert layer["stiffness"] == pytest.approx(1e6 * 0.7 / (1.3 * 0.4 * 1e-3))


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--path", "0.5,0.6,out"], "after loading it must unload"),
        (["--path", "-0.5,out"], "it must start with loading"),
        (["--path", "0.5,0.2,out"], "ends with unloading to 0.2 and goes out: omit that turning"),
        (["--path", "out"], "holds no turning point"),
        (["--path", "0.5,x"], "must be numbers with commas"),
        (["--path", "0.5", "--max-penetration", "0.5"], "a loop has one of them"),
        (
            ["--max-penetration", "90%"],
            "--max-penetration is '90%': it must be one or more numbers between 0 and 1, as 0.9 or",
        ),
        (["--max-penetration", "0.5,0.5"], "turning points must differ"),
        (["--stiffness", "0"], "needs --max-stress"),
        (["--max-stress", "100"], "belongs to load control"),
        (["--layer", "1e-3"], "poisson is 0.5"),
        (["--layer", "1e-3", "--stiffness", "1"], "--layer are given: give one of them"),
        (["--figure", "loop.bmp"], "must end in .png"),
        (["--path", "0.5,out", "--fields", "f.npz"], "--fields belongs to one loop"),
    ],
)
def test_what_cannot_be_followed_is_refused_in_one_sentence(words, sentence, capsys):
    if words[0] == "--path":
        words = [f"--path={words[1]}", *words[2:]]
    assert main([*SCENE, *words]) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert len(error.splitlines()) == 1


def test_a_load_that_runs_away_ends_in_where_it_does(tmp_path, capsys):
    out = tmp_path / "x.json"
    words = ["--stiffness", "0", "--max-stress", "100", "--work-of-adhesion", "1"]
    assert main([*replacing(SCENE, words), "--json", str(out)]) == 1
    assert capsys.readouterr().err == (
        "adhesis loop: under a load this surface is drawn into full contact at first touch (γ = 1 "
        "J/m², E = 1e6 Pa): give --stiffness K, or prescribe the separation by leaving --stiffness "
        "out\n"
    )
    assert not out.exists()
