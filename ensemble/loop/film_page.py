"""The page of a film: slider, button, and the script that moves the figure."""

from __future__ import annotations

STYLE = """
body { font: 15px/1.4 system-ui, sans-serif; color: #111; background: #fff;
       max-width: 60rem; margin: 0 auto; padding: 0.5rem; }
h1 { font-size: 1.1rem; margin: 0.2rem 0; }
p { margin: 0.2rem 0; font-variant-numeric: tabular-nums; }
svg { width: 100%; height: auto; }
#controls { display: flex; gap: 0.6rem; align-items: center; }
#slider { flex: 1; }
#jump { color: #b04a00; font-weight: bold; min-height: 1.4em; }
"""

BODY = """
<h1>@TITLE@</h1>
<p>@JUMPS@</p>
@SVG@
<div id="controls">
<button id="play" type="button">Play</button>
<input id="slider" type="range" min="0" max="@LAST@" value="0" aria-label="frame">
<span id="number"></span>
</div>
<p id="state"></p>
<p id="jump" role="status"></p>
<script>
const film = @DATA@;
const get = id => document.getElementById(id);
const slider = get("slider"), button = get("play");
const body = document.querySelector("#film-body path");
const contact = document.querySelector("#film-contact path");
const point = document.querySelector("#film-point use");
const last = film.frames.length - 1;
let timer = null;

// The surface at i, in units of the spacing of film.x.
function at(y, i) {
  const k = Math.min(Math.floor(i), y.length - 2), part = i - k;
  const x = film.x[k] + part * (film.x[k + 1] - film.x[k]);
  return (x / 10).toFixed(2) + " " + ((y[k] + part * (y[k + 1] - y[k])) / 10).toFixed(2);
}

function show(number) {
  const frame = film.frames[number], y = [];
  let sum = 0;
  for (const step of frame.y) y.push(sum += step);
  const end = film.x.length - 1, top = Math.min(film.top, ...y) / 10;
  const line = y.map((v, i) => film.x[i] / 10 + " " + v / 10).join("L");
  body.setAttribute("d", `M${line}L${film.x[end] / 10} ${top}L${film.x[0] / 10} ${top}z`);
  let patches = "";
  for (let k = 0; k < frame.c.length; k += 2) {
    const left = frame.c[k] / 1000, right = frame.c[k + 1] / 1000, places = [left];
    for (let i = Math.floor(left) + 1; i < right; i++) places.push(i);
    patches += "M" + [...places, right].map(i => at(y, i)).join("L");
  }
  contact.setAttribute("d", patches);
  point.setAttribute("x", frame.p[0] / 10);
  point.setAttribute("y", frame.p[1] / 10);
  slider.value = number;
  get("number").textContent = `${number + 1} of ${last + 1}`;
  get("state").textContent = frame.s;
  get("jump").textContent = frame.j;
}

function stop() {
  clearTimeout(timer);
  timer = null;
  button.textContent = "Play";
}

// A jump of a hundredth of the loss or more is held long enough to be read.
function play() {
  const number = Number(slider.value);
  if (number >= last) return stop();
  show(number + 1);
  timer = setTimeout(play, (film.frames[number + 1].n ? 8 : 1) * 1000 / film.rate);
}

button.addEventListener("click", () => {
  if (timer !== null) return stop();
  if (Number(slider.value) >= last) show(0);
  button.textContent = "Pause";
  timer = setTimeout(play, 1000 / film.rate);
});
slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
show(0);
</script>
"""
