"""``adhesis loop``: what it writes, and what it refuses before it computes or writes anything."""

import hashlib
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

import adhesis
import adhesis.ensemble.command.loop as loop_command
from adhesis.ensemble.command.main import main
from adhesis.ensemble.quantities import units_of
from adhesis.ensemble.versions import provenance
from adhesis.solver.references.single_wave import SingleWave
from tests.support.campaign_support import table_of
from tests.support.exact_wave import ExactWave
from tests.support.options import SCENE, replacing, rough_loop
from tests.support.scenes import HALF_SPACE

PERIOD, AMPLITUDE, ALPHA = 1e-3, 1e-9, 0.2
MODULUS = 1e6 / 0.75
WAVE = SingleWave.with_alpha(ALPHA, AMPLITUDE, PERIOD, MODULUS)
GAMMA = WAVE.work_of_adhesion

STATE_KEYS = {"branch", "penetration", "mean_stress", "contact_fraction", "patches", "energy"}
ONCE_KEYS = {"h_max", "h_rms", "m2", "loss", "loss_dimensionless", "loss_from_drops", "seconds"}


@pytest.fixture
def wave_file(tmp_path):
    """Heights of one wave on 16 nodes, with a mean that must not matter."""
    path = tmp_path / "wave.npy"
    np.save(path, 3e-6 + AMPLITUDE * np.cos(2 * np.pi * np.arange(16) / 16))
    return path


@pytest.fixture
def exact_method(monkeypatch):
    monkeypatch.setattr(loop_command, "make_method", lambda name, problem, **_: ExactWave(problem))


def run(*words) -> int:
    return main(["loop", *(str(word) for word in words)])


MATERIAL = ("--work-of-adhesion", GAMMA, "--young", 1e6, "--poisson", 0.5)


def wave_words(path, *more):
    return ("--heights", path, "--period", PERIOD, *MATERIAL, *more)


STRIPES = ("--stripes", 1, "--stripe-amplitude", 0.5, "--stripe-phase", 3.141592653589793)


def test_stripes_lower_the_loss_of_a_wave_whose_crest_is_weak(wave_file, tmp_path, capsys):
    out = tmp_path / "loop.json"
    words = wave_words(wave_file, "--max-penetration", 0.8, "--json", out, "--load-steps", 5)
    assert run(*words, *STRIPES) == 0
    data = json.loads(out.read_text())
    assert data["work_of_adhesion"] == GAMMA
    assert data["least_work_of_adhesion"] == pytest.approx(0.5 * GAMMA, rel=1e-9)
    assert data["stripes"] == 1
    assert (data["stripe_amplitude"], data["stripe_phase"]) == pytest.approx((0.5, np.pi))
    assert (data["adhesion_range"], data["zone_error"]) == (0.0, 0.0)
    assert 0.1 * WAVE.loop.loss < data["loss"] < 0.6 * WAVE.loop.loss
    assert "J/m² along the profile)" in capsys.readouterr().out


RANGE = 0.1 * AMPLITUDE


@pytest.mark.parametrize(
    "words", [("--strength", GAMMA / RANGE), ("--adhesion-range", RANGE, "--measure", "flat")]
)
def test_json_names_range_and_measure_and_what_zones_at_edges_change(
    words, wave_file, tmp_path, capsys
):
    out = tmp_path / "loop.json"
    steps = ("--max-penetration", 0.8, "--load-steps", 5, "--json", out, "--method", "sharp")
    assert run(*wave_words(wave_file, *steps, *words)) == 0
    data, text = json.loads(out.read_text()), capsys.readouterr().out
    assert data["adhesion_range"] == pytest.approx(RANGE, rel=1e-12)
    assert data["strength"] == pytest.approx(GAMMA / RANGE, rel=1e-12)
    share = 0.05 * (RANGE / data["edge_range"]) ** 4
    assert data["zone_error"] == pytest.approx(share * data["loss"], rel=1e-9)
    assert (data["stripes"], data["stripe_amplitude"], data["stripe_phase"]) == (None,) * 3
    assert data["openings"] == 0
    assert data["measure"] == ("flat" if "flat" in words else "arc")
    assert (", flat measure, " in text) == ("flat" in words)


@pytest.mark.usefixtures("exact_method")
def test_json_holds_the_promised_keys_and_the_exact_loop(wave_file, tmp_path, capsys):
    out = tmp_path / "loop.json"
    assert run(*wave_words(wave_file, "--max-penetration", 0.8, "--json", out)) == 0
    data = json.loads(out.read_text())
    assert data.keys() >= ONCE_KEYS | STATE_KEYS | {"method", "jumps", "states"}
    assert data["h_max"] == pytest.approx(AMPLITUDE, rel=1e-6)
    assert data["h_rms"] == pytest.approx(AMPLITUDE / np.sqrt(2), rel=1e-6)
    assert data["m2"] == pytest.approx((2 * np.pi * AMPLITUDE / PERIOD) ** 2 / 2, rel=1e-6)
    assert data["loss_from_drops"] == pytest.approx(WAVE.loop.loss, rel=1e-6)
    assert data["loss"] == pytest.approx(WAVE.loop.loss, rel=1e-4)
    assert data["loss_dimensionless"] == pytest.approx(1.2018194e-2, rel=1e-4)
    assert data["method"] == "exact wave"
    assert [j["kind"] for j in data["jumps"]] == ["snap-in", "pull-off"]
    assert [j["branch"] for j in data["jumps"]] == ["loading", "unloading"]
    assert data["jumps"][1]["penetration"] == pytest.approx(1 - 1.25204901072, abs=1e-6)
    drops = [j["energy_drop"] for j in data["jumps"]]
    assert drops == pytest.approx([WAVE.loop.touch_drop, WAVE.loop.fold_drop], rel=1e-6)
    # tension falls from the edges of a wave: nothing bounds the range, and JSON has no infinity
    assert (data["valid_range"], data["interior_tension"]) == (None, None)
    assert data["largest_interior_tension"] == 0.0
    # The same states, as objects and as columns.
    assert len(data["states"]) == len(data["penetration"]) > 40
    for key in STATE_KEYS:
        assert [state[key] for state in data["states"]] == data[key]
    loss = np.trapezoid(data["mean_stress"], data["penetration"]) * data["h_max"]
    assert data["loss"] == pytest.approx(loss, rel=1e-12)
    assert set(data["branch"]) == {"loading", "unloading"}
    text = capsys.readouterr()
    assert data["loss_over_work_of_adhesion"] == data["loss"] / GAMMA
    assert f"{data['loss']:.6g} J/m², {data['loss'] / GAMMA:.4g} γ (dimensionless" in text.out
    assert str(out) in text.out
    assert "defaults" not in text.out  # of a profile, which heights take the place of
    assert "unloading" in text.err


@pytest.mark.usefixtures("exact_method")
def test_provenance_is_that_of_program_command_and_input(wave_file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = wave_words(wave_file, "--load-steps", 3, "--json", "o.json", "--quiet")
    assert run(*words) == 0
    data = json.loads(Path("o.json").read_text())
    found = data["provenance"]
    assert found["command"] == shlex.join(["adhesis", "loop", *map(str, words)])
    assert found["input"] == {
        "file": str(wave_file),
        "bytes": wave_file.stat().st_size,
        "sha256": hashlib.sha256(wave_file.read_bytes()).hexdigest(),
    }
    assert found["seed"] is None
    assert found["adhesis_version"] == adhesis.__version__
    assert {"commit", "python", "numpy", "kernels", "processor", "date"} <= found.keys()
    units = found["units"]
    assert units["states.mean_stress"] == units["mean_stress"] == "Pa"
    assert units["jumps.energy_drop"] == units["loss"] == "J/m²"
    assert units["turning_point"] == units["penetration"] == units["m2"] == "1"
    assert units["h_max"] == units["valid_range"] == units["states.separation"] == "m"
    assert (units["m0"], units["m4"], units["states.energy"]) == ("m²", "1/m²", "J/m")
    assert (units["young"], units["stiffness"], units["seconds"]) == ("Pa", "Pa/m", "s")
    numbers = {name for name, value in data.items() if isinstance(value, int | float)}
    assert numbers - units.keys() == set()


def test_the_seed_is_kept_and_turning_points_of_a_load_are_in_pa():
    document = {"stiffness": 0.0, "turning_point": 500.0, "minor_loops": [{"start": 1.0}]}
    units = units_of(document)
    assert units == {"stiffness": "Pa/m", "turning_point": "Pa", "minor_loops.start": "Pa"}
    assert provenance(["loop"], None, 3, document)["seed"] == 3
    assert provenance(["loop"], None, 3, document)["input"] is None


@pytest.mark.usefixtures("exact_method")
def test_the_curve_as_csv_has_units_in_its_header(wave_file, tmp_path):
    out, table = tmp_path / "o.json", tmp_path / "o.csv"
    words = ("--load-steps", 4, "--json", out, "--csv", table, "--quiet")
    assert run(*wave_words(wave_file, *words)) == 0
    data = json.loads(out.read_text())
    rows = table_of(table)
    assert list(rows[0])[:5] == [
        *("branch", "load_step", "penetration (h_max)", "separation (m)", "mean_stress (Pa)")
    ]
    for column, key in (("mean_stress (Pa)", "mean_stress"), ("energy (J/m)", "energy")):
        assert [float(row[column]) for row in rows] == data[key]
    assert [row["branch"] for row in rows] == data["branch"]
    assert run(*wave_words(wave_file, *words, "--max-penetration", "0.3,0.6")) == 0
    assert {row["turning_point (h_max)"] for row in table_of(table)} == {"0.3", "0.6"}
    assert run(*wave_words(wave_file, *words, "--path", "0.5,0.2,0.4,out")) == 0
    assert {row["leg"] for row in table_of(table)} == {"0", "1", "2", "3"}


@pytest.mark.usefixtures("exact_method")
def test_a_figure_as_pdf_has_truetype_fonts_and_mathematics(wave_file, tmp_path):
    figure = tmp_path / "loop.pdf"
    assert run(*wave_words(wave_file, "--load-steps", 3, "--figure", figure, "--quiet")) == 0
    assert "Type3" not in fonts_of(figure)
    loop = adhesis.run_loop(
        ExactWave(adhesis.Problem(adhesis.single_wave(1e-9, 1e-3), HALF_SPACE, GAMMA)),
        max_penetration=0.5,
        load_steps=2,
    )
    drawn = loop.plot()
    drawn.savefig(tmp_path / "plot.pdf")  # as a user of the library does, without the style
    assert "Type3" not in fonts_of(tmp_path / "plot.pdf")
    labels = {axes.get_xlabel() for axes in drawn.axes} | {axes.get_ylabel() for axes in drawn.axes}
    assert labels == {
        r"penetration $\Delta/h_{\max}$",
        r"mean stress $\bar p$ (kPa)",
        "contact fraction $A/A_0$",
    }


def fonts_of(path):
    fonts = re.findall(rb"/Subtype\s*/(Type0|Type1|Type3|TrueType|CIDFontType2)", path.read_bytes())
    assert fonts
    return {name.decode() for name in fonts}


@pytest.mark.usefixtures("exact_method")
def test_fields_are_those_of_the_chosen_penetrations(wave_file, tmp_path):
    out = tmp_path / "fields.npz"
    words = ("--max-penetration", 0.8, "--load-steps", 7, "--fields", out, "--field-nodes", 512)
    assert run(*wave_words(wave_file, *words, "--field-penetrations", 0.33, 0.8, -0.1, -0.9)) == 0
    data = np.load(out)
    assert list(data["branch"]) == ["loading"] * 4 + ["unloading"] * 4
    assert list(data["penetration"]) == [0.33, 0.8, -0.1, -0.9] * 2
    assert data["stress"].shape == data["gap"].shape == (8, 512)
    assert data["separation"] == pytest.approx(AMPLITUDE * (1 - data["penetration"]), rel=1e-6)
    in_contact = ~np.isnan(data["edges"][:, 0, 0])
    # Loading: nothing before first touch. Unloading: still stuck at -0.1, long off at -0.9.
    assert list(in_contact) == [True, True, False, False, True, True, True, False]
    for i in np.flatnonzero(in_contact):
        width = np.ptp(data["edges"][i, 0])
        exact = 2 * WAVE.half_width(float(data["separation"][i]))
        assert width == pytest.approx(exact, rel=1e-5)
        # The profile's crest is at x = 0: compare σ and t where no edge is near.
        x = np.array([0, 128, 256])
        a = exact / 2
        assert data["stress"][i, x] == pytest.approx(
            WAVE.stress(data["x"][x], a), rel=1e-4, abs=1e-12
        )
        assert data["gap"][i, x] == pytest.approx(WAVE.gap(data["x"][x], a), rel=1e-4, abs=1e-15)
    assert data["gap"].mean(axis=1) == pytest.approx(data["separation"], rel=2e-3)
    assert np.all(data["stress"][~in_contact] == 0)


@pytest.mark.usefixtures("exact_method")
def test_an_error_of_adhesis_itself_leaves_no_file(wave_file, tmp_path, monkeypatch, capsys):
    def broken(self, state, n):
        raise FloatingPointError("no fields")

    monkeypatch.setattr(ExactWave, "fields", broken)
    out, fields = tmp_path / "loop.json", tmp_path / "fields.npz"
    words = wave_words(wave_file, "--load-steps", 2, "--json", out, "--fields", fields)
    assert run(*words) == 70
    assert "FloatingPointError: no fields" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["wave.npy"]


@pytest.mark.parametrize(
    ("young", "cycle", "code"),
    [
        (1e7, ("--max-penetration", "0.5,0.9"), 0),
        (1e11, ("--max-penetration", "0.9"), 1),
        (1e11, ("--path", "0.9,out"), 1),
    ],
)
def test_a_loss_beyond_the_zero_range_limit_is_said_and_strict(
    young, cycle, code, tmp_path, capsys
):
    out = tmp_path / "loop.json"
    words = ("--hurst", 0.8, "--seed", 0, "--period", 2e-3, "--n0", 2, "--ratio", 4)
    more = ("--load-steps", 10, "--strict", "--quiet", "--json", out)
    assert run(*words, "--young", young, *cycle, *more) == code
    data, text = json.loads(out.read_text()), capsys.readouterr()
    assert (data["valid_range"] < 1e-9) == (code == 1)
    assert data["valid_range"] == data["work_of_adhesion"] / data["largest_interior_tension"]
    assert data["interior_tension"]["branch"] == "unloading"
    least = min(data["valid_range"], data["edge_range"], data["touch_range"])
    assert f"reaches less than {1e9 * least:.3g} nm (tension" in text.out
    assert [f"adhesis loop: {warning}" for warning in data["warnings"]] == text.err.splitlines()
    assert bool(data["warnings"]) == (code == 1)
    assert not any(turn["warnings"] for turn in data.get("turns", []))


def test_defaults_of_a_profile_and_material_are_stated_where_they_are_taken(capsys):
    words = ("--hurst", 0.8, "--n0", 4, "--ratio", 4, "--load-steps", 2, "--young", 1e6, "--quiet")
    assert run(*words) == 0
    (line,) = (t for t in capsys.readouterr().out.splitlines() if t.startswith("defaults"))
    assert "--period 6.2832mm --seed 0 --h-rms 1um --work-of-adhesion 0.04 --poisson 0.5" in line
    assert run(*words, "--period", "1mm", "--m2", 1e-3, "--nodes-per-wave", 16) == 0
    lines = capsys.readouterr().out.splitlines()
    (line,) = (t for t in lines if t.startswith("defaults"))
    assert any(t.startswith("method      grid, ") for t in lines)
    assert "--period" not in line
    assert "--h-rms" not in line


def test_several_turning_points_are_turns_of_one_document(tmp_path):
    figure = tmp_path / "loops.png"
    document, *_ = rough_loop(tmp_path, "--max-penetration", "0.6,0.3,0.8", "--figure", figure)
    assert [turn["max_penetration"] for turn in document["turns"]] == [0.3, 0.6, 0.8]
    losses = [turn["loss"] for turn in document["turns"]]
    assert losses == sorted(losses)
    assert document["loss"] == losses[-1]
    for turn in document["turns"]:
        assert turn["work_spent"] - turn["work_gained"] == pytest.approx(turn["loss"])
    assert imread(figure).ndim == 3


def test_a_path_tells_of_its_minor_loops(tmp_path):
    document, text, _ = rough_loop(tmp_path, "--path", "0.8,0.3,0.6,out")
    (minor,) = document["minor_loops"]
    assert (minor["start"], minor["turn"]) == (0.3, 0.6)
    assert document["out"]
    assert set(document["leg"]) == {0, 1, 2, 3}
    assert "minor loop  0.3, 0.6, 0.3:" in text
    stays, *_ = rough_loop(tmp_path, "--path", "0.8,0.3", "--work-of-adhesion", "0.01")
    assert not stays["out"]
    assert stays["energy_change"] < 0


def test_a_stiffness_and_a_load(tmp_path):
    fixed, *_ = rough_loop(tmp_path, "--max-penetration", "0.5")
    soft, text, _ = rough_loop(tmp_path, "--max-penetration", "0.5", "--stiffness", "1e9")
    assert fixed["stiffness"] is None
    assert soft["stiffness"] == 1e9
    assert soft["loss"] > fixed["loss"]
    assert max(soft["displacement"]) == pytest.approx(0.5)
    assert "held by 1e+09 Pa/m" in text
    load, *_ = rough_loop(tmp_path, "--stiffness", "0", "--max-stress", "500")
    assert max(load["mean_stress"]) == pytest.approx(500)
    layer_words = ("--max-penetration", "0.5", "--poisson", "0.3", "--layer", "1e-3")
    layer, *_ = rough_loop(tmp_path, *layer_words)
    assert layer["stiffness"] == pytest.approx(1e6 * 0.7 / (1.3 * 0.4 * 1e-3))


def test_a_load_that_runs_away_ends_in_where_it_does(tmp_path, capsys):
    out = tmp_path / "x.json"
    words = ["--stiffness", "0", "--max-stress", "100", "--work-of-adhesion", "1"]
    assert main([*replacing(SCENE, words), "--json", str(out)]) == 1
    assert capsys.readouterr().err == (
        "adhesis loop: under a load this surface is drawn into full contact at first touch (γ = 1 "
        "J/m², E = 1e6 Pa): for a machine that turns at a mean stress give --preload in place of "
        "--stiffness 0 --max-stress, or prescribe the separation by leaving --stiffness out\n"
    )
    assert not out.exists()
