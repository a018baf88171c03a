"""The film of a loop: which states are its frames, what each shows, and the page in a browser."""

import html
import json
import re

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from PIL import Image

import adhesis.ensemble.loop.film as scenes_module
from adhesis import Control, InputError, LoopResult, Problem, run_loop, single_wave
from adhesis.ensemble.command.main import main
from adhesis.ensemble.loop.film import Film
from tests.support.browser import needs_browser, seen_by_browser
from tests.support.exact_wave import ExactWave
from tests.support.scenes import HALF_SPACE, loop_of, rough


@pytest.fixture(scope="module")
def loop() -> LoopResult:
    problem = Problem(rough(2, 8, 3), HALF_SPACE, 0.02)
    return loop_of(problem, max_penetration=0.8, load_steps=8)


@pytest.fixture(scope="module")
def film(loop: LoopResult) -> Film:
    return loop.film(frames=30)


def data_of(page: str) -> dict:
    found = re.search(r"^const film = (\{.*\});$", page, re.MULTILINE)
    return json.loads(found[1])


def test_every_jump_has_a_frame_before_and_one_after_it_that_announces_its_drop(loop, film):
    assert len(loop.jumps) > 5
    scenes = {scene.state: scene for scene in film.scenes}
    assert list(scenes) == sorted(scenes)
    assert {0, len(loop.separation) - 1} <= set(scenes)
    assert len(scenes) >= 30
    for jump, place in zip(loop.jumps, loop.states_before_jumps(), strict=True):
        assert loop.contact_fraction[place + 1] == jump.contact_after
        assert place in scenes
        announced = scenes[place + 1].announcement
        assert announced == f"jump ({jump.kind}): energy drop {jump.energy_drop:.3g} J/m²"
    announced = [scene for scene in scenes.values() if scene.announcement]
    assert len(announced) == len(loop.jumps)
    assert f"lost {loop.loss_from_drops:.3g} J/m²" in film.scenes[-1].caption


def test_frames_are_even_along_the_path(loop):
    states = [scene.state for scene in Film(loop, 40).scenes]
    way = np.concatenate([[0], np.cumsum(np.abs(np.diff(loop.penetration)))])
    widest = max(np.diff(way).max(), way[-1] / 39)
    assert np.diff(way[states]).max() <= 2 * widest


def test_of_more_jumps_than_frames_those_with_the_largest_drops_are_shown(loop, monkeypatch):
    monkeypatch.setattr(scenes_module, "MOST_FRAMES", 12)
    film = loop.film(frames=4)
    shown = film.jumps_shown
    assert len(film) <= 12
    assert 0 < shown < len(loop.jumps)
    states = {scene.state for scene in film.scenes}
    places = dict(zip(loop.states_before_jumps(), loop.jumps, strict=True))
    drops = sorted((jump.energy_drop for jump in loop.jumps), reverse=True)
    for place, jump in places.items():
        if jump.energy_drop >= drops[shown - 1]:
            assert {place, place + 1} <= states
    assert f"of which the {shown} with the largest drops have frames of their own" in film.page
    # those without a frame are counted where they happen
    together = [scene.announcement for scene in film.scenes if scene.announcement]
    assert any(" jumps (" in text for text in together)


@pytest.mark.parametrize("control", [Control(), Control(1e9), Control(0.0)])
def test_a_frame_shows_the_exact_surface_and_patches(control):
    problem = Problem(single_wave(1e-6, 1e-3), HALF_SPACE, 1e-3, control)
    method = ExactWave(problem, states_per_step=4)
    turn = {"max_stress": 500.0} if control.is_load else {"max_penetration": 0.5}
    loop = run_loop(method, load_steps=4, **turn)
    scenes = Film(loop, 20)
    for scene in scenes.scenes:
        state = loop.contact_states[scene.state]
        if not state.patches:
            assert np.all(scene.surface == state.separation)
            assert scene.patches.size == 0
            continue
        exact = scenes.height + method.wave.gap(scenes.x - method.crest, state.internal)
        assert np.abs(scene.surface - exact).max() < 1e-9
        assert np.diff(scene.patches, axis=1).sum() == pytest.approx(2 * state.internal)
    assert next(len(s.patches) for s in scenes.scenes if len(s.patches)) == 2  # across the period


def test_the_page_holds_every_frame_and_nothing_from_elsewhere(loop, film, tmp_path):
    file = tmp_path / "loop.html"
    made = loop.film(file, frames=30)
    assert repr(made) == f"<Film: {len(film)} frames, {len(loop.jumps)} jumps>"
    page = file.read_text()
    assert page == made.page == film.page
    assert len(data_of(page)["frames"]) == len(film)
    assert f'max="{len(film) - 1}"' in page
    # the largest film is less than 5 MB
    frames = len(json.dumps(data_of(page)["frames"], separators=(",", ":")))
    assert len(page.encode()) + frames / len(film) * scenes_module.MOST_FRAMES < 5e6
    assert re.findall(r'(?:src|href)="(?!#)[^"]*"', page) == []
    assert html.unescape(made._repr_html_().split('srcdoc="')[1].split('" title=')[0]) == page


@pytest.mark.parametrize("ending", [".gif", ".mp4"])
def test_animations_are_written_by_their_writers(loop, tmp_path, ending):
    if ending == ".mp4" and not FFMpegWriter.isAvailable():
        pytest.skip("ffmpeg, which writes .mp4, is not installed")
    file = tmp_path / f"loop{ending}"
    film = loop.film(frames=2)
    film.scenes[:] = film.scenes[4:8]  # equal frames are one in a .gif
    drawn = []
    film.save(file, progress=lambda number, total: drawn.append((number, total)))
    assert drawn == [(1, 4), (2, 4), (3, 4), (4, 4)]
    if ending == ".gif":
        with Image.open(file) as picture:
            assert picture.n_frames == 4
            assert picture.size == (720, 496)
    else:
        assert file.read_bytes()[4:8] == b"ftyp"


def test_without_ffmpeg_an_mp4_is_refused(loop, monkeypatch):
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(InputError, match="ffmpeg, which writes \\.mp4, is not installed"):
        loop.film("a.mp4")


def test_the_command_writes_the_film_of_a_loop_and_of_a_path(tmp_path, capsys):
    scene = "loop --hurst 0.8 --n0 2 --ratio 4 --load-steps 4 --quiet"
    for k, way in enumerate(("--max-penetration 0.5", "--path 0.5,0.2,0.6,out")):
        file = tmp_path / f"{k}.html"
        assert main([*f"{scene} {way}".split(), "--film", str(file)]) == 0
        assert f"wrote       {file}" in capsys.readouterr().out
        assert len(data_of(file.read_text())["frames"]) > 20


_PROBE = """
const look = () => ({
  slider: Number(slider.value), state: get("state").textContent, jump: get("jump").textContent,
  number: get("number").textContent, body: body.getAttribute("d"), point: point.getAttribute("x"),
  contact: contact.getAttribute("d"), button: button.textContent,
  box: [body.getBBox().width, body.getBBox().height]
});
const seen = {frames: film.frames.length, last: Number(slider.max), first: look(), moved: []};
const errors = [];
window.onerror = text => { errors.push(text); };
for (let k = 0; k <= last; k++) {
  slider.value = k;
  slider.dispatchEvent(new Event("input"));
  seen.moved.push(look());
}
slider.value = 0;
slider.dispatchEvent(new Event("input"));
button.click();
seen.playing = look();
const wait = setInterval(() => {
  if (button.textContent === "Pause") return;
  clearInterval(wait);
  seen.ended = look();
  button.click();
  setTimeout(() => {
    button.click();
    seen.paused = look();
    reportSeen({...seen, errors});
  }, 250);
}, 100);
"""


@needs_browser
def test_the_page_plays_in_a_browser_and_its_slider_moves_the_state(film, tmp_path):
    seen = seen_by_browser(film.page, _PROBE, tmp_path)
    assert seen["errors"] == []
    scenes = film.scenes
    assert seen["frames"] == len(scenes) == seen["last"] + 1
    for k, (shown, scene) in enumerate(zip(seen["moved"], scenes, strict=True)):
        assert shown["slider"] == k
        assert shown["number"] == f"{k + 1} of {len(scenes)}"
        assert shown["state"] == scene.caption
        assert shown["jump"] == scene.announcement
        assert min(shown["box"]) > 50
        assert (shown["contact"].count("M")) == len(scene.patches)
    for name in ("body", "point"):
        assert len({shown[name] for shown in seen["moved"]}) > len(scenes) / 2
    assert seen["first"] == seen["moved"][0]
    assert seen["playing"]["button"] == "Pause"
    assert seen["ended"]["slider"] == len(scenes) - 1
    assert 0 < seen["paused"]["slider"] < len(scenes) - 1
    assert seen["paused"]["button"] == "Play"
