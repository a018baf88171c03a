"""The film of a loop or path: its frames, and a figure that is moved from one to the next.

Every jump has a frame before it and one after it, as far as the number of frames allows.

One figure serves all formats. A ``.gif`` or ``.mp4`` is written frame by frame by matplotlib's
writers. The page is the figure as SVG, in which a short script moves what changes: it stays sharp
at any size, and takes about 3 KB a frame, where an embedded picture takes some 40 KB.
"""

from __future__ import annotations

import io
import json
import os
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.files import check_ending, check_outputs, whole_file
from adhesis.ensemble.loop.record import Result
from adhesis.ensemble.report.figures.style import LINE_OF_BRANCH, new_figure, style
from adhesis.solver import checks
from adhesis.solver.checks import Bounds, counted, function, whole
from adhesis.solver.loading.path import PathResult
from adhesis.solver.method import ContactState, Method
from adhesis.solver.model.jump import Jump
from adhesis.solver.model.profile import Array

MOST_FRAMES = 1000
_FRAMES = Bounds(2, MOST_FRAMES, whole=True)
_NODES = 800  # of the drawn surface: about one a pixel
FORMATS = (".html", ".gif", ".mp4")
_WIDTH, _HEIGHT = 9.0, 6.2  # inches
_DPI = 80  # of .gif and .mp4: 720 × 496 pixels, even numbers, as mp4 wants them
_RATE = 10  # frames a second
_TENTH = 10.0  # coordinates of the page are whole tenths of a point
# A surface far above the profile, on long necks, is cut off: the profile keeps a third.
_MOST_RANGE = 3.0
_LOOK: Any = {
    **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize"), 9),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), 8),
    "axes.formatter.use_mathtext": False,  # text of the page stays text
    "savefig.bbox": None,
    "svg.fonttype": "none",
    "svg.hashsalt": "adhesis",
}


@dataclass(frozen=True)
class Scene:
    """One frame."""

    state: int  # number of the state in the result
    surface: Array  # height above the profile's mean line in m, shape (nodes,)
    patches: Array  # ends in m, shape (patches, 2), within the period; one across its end is two
    caption: str  # the state in numbers
    announcement: str  # the jumps since the frame before; empty without any
    is_notable: bool  # whether those jumps lose a hundredth of all drops or more


def _chosen(result: Result, places: Sequence[int], frames: int) -> tuple[list[int], int]:
    """Numbers of the states that are shown, and of how many jumps."""
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(result.penetration)))])
    even = np.searchsorted(way, np.linspace(0.0, way[-1], frames))
    chosen = {0, len(way) - 1, *np.minimum(even, len(way) - 1).tolist()}
    order = sorted(range(len(places)), key=lambda k: -result.jumps[k].energy_drop)
    shown = 0
    for k in order:
        more = chosen | {places[k], places[k] + 1}
        if len(more) > MOST_FRAMES:
            break
        chosen = more
        shown += 1
    return sorted(chosen), shown


def _surface(method: Method, state: ContactState, x: Array, height: Array) -> Array:
    """Return the surface h + t: the gap t from the opening of each gap, on the circle."""
    if not state.patches:
        return np.full(x.size, state.separation)
    gap = np.zeros(x.size)
    period = method.problem.profile.period
    for opening in method.openings(state):
        for turn in (0.0, period):
            inside = (x + turn > opening.x[0]) & (x + turn < opening.x[-1])
            gap[inside] = np.interp(x[inside] + turn, opening.x, opening.gap)
    return np.asarray(height + gap)


def _patches(state: ContactState, period: float) -> Array:
    parts = []
    for left, right in state.edges:
        if right > period:
            parts += [(left, period), (0.0, right - period)]
        else:
            parts.append((left, right))
    return np.array(parts).reshape(-1, 2)


def _drop(jumps: Sequence[Jump]) -> float:
    return float(sum(jump.energy_drop for jump in jumps))


def _caption(result: Result, index: int, jumps: int) -> str:
    lost = _drop(result.jumps[:jumps])
    patches = counted(int(result.patches[index]), "patch")
    return (
        f"{result.branch[index]}: Δ/h_max {result.penetration[index]:.3f}, mean stress "
        f"{result.mean_stress[index]:.4g} Pa, A/A0 {result.contact_fraction[index]:.3f}, "
        f"{patches}; {jumps} of {counted(len(result.jumps), 'jump')} so far "
        f"lost {lost:.3g} J/m²"
    )


def _announcement(jumps: Sequence[Jump]) -> str:
    if not jumps:
        return ""
    if len(jumps) == 1:
        return f"jump ({jumps[0].kind}): energy drop {jumps[0].energy_drop:.3g} J/m²"
    kinds = Counter(jump.kind for jump in jumps)
    several = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
    return f"{len(jumps)} jumps ({several}): energy drops {_drop(jumps):.3g} J/m² in all"


def check_film(name: str, path: str | os.PathLike[str]) -> Path:
    """Return the path of a film that can be made here; ``name`` is the option or parameter.

    InputError for an ending that is none of :data:`FORMATS`, or without ffmpeg for .mp4.
    """
    path = Path(checks.path(name, path))
    ending = path.suffix.lower()
    check_ending(name, path, *FORMATS)
    if ending == ".mp4" and not FFMpegWriter.isAvailable():
        why = "ffmpeg, which writes .mp4, is not installed"
        raise InputError(f"{name} is {path}: {why}, so take .html or .gif")
    return path


class Film:
    """A loop as a film; made by :meth:`adhesis.LoopResult.film`, shown by a notebook.

    It has evenly spaced frames, and on top those of jumps.

    Parameters
    ----------
    result : LoopResult or PathResult
    frames : int
    progress : callable, optional
        Called with the numbers of frames computed so far, and of all.

    Raises
    ------
    ValueError
        If ``frames`` is out of range, or the result holds no contact states.
    """

    def __init__(
        self, result: Result, frames: int, progress: Callable[[int, int], None] | None = None
    ) -> None:
        frames = whole("frames", frames, _FRAMES)
        function("progress", progress)
        if not result.contact_states or result.new_method is None:
            raise ValueError(
                "this result holds no contact states, as it was read from a file: run the loop "
                "again to film it"
            )
        self.result, method, profile = result, result.new_method(), result.problem.profile
        self.x = np.linspace(0.0, profile.period, _NODES)  # in m, both ends included
        self.height = profile.at(self.x)  # of the rigid profile there, in m
        self.scenes: list[Scene] = []  # in the order of the path
        places = result.states_before_jumps()
        # jumps_shown: number of jumps that have a frame before and one after them
        chosen, self.jumps_shown = _chosen(result, places, frames)
        last = -1
        for done, index in enumerate(chosen, 1):
            state = result.contact_states[index]
            since = [j for j, p in zip(result.jumps, places, strict=True) if last <= p < index]
            before = sum(p < index for p in places)
            shapes = _surface(method, state, self.x, self.height), _patches(state, profile.period)
            texts = _caption(result, index, before), _announcement(since)
            is_notable = _drop(since) > 0.01 * _drop(result.jumps)
            self.scenes.append(Scene(index, *shapes, *texts, is_notable))
            last = index
            if progress is not None:
                progress(done, len(chosen))

    def __repr__(self) -> str:
        return f"<Film: {len(self)} frames, {counted(len(self.result.jumps), 'jump')}>"

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.scenes)

    def _repr_html_(self) -> str:
        """Return the page in a frame of its own, for notebooks."""
        return (
            f'<iframe srcdoc="{escape(self.page)}" title="film of a loop" loading="lazy" '
            'style="width:100%;max-width:60rem;height:48rem;border:0"></iframe>'
        )

    def save(
        self, path: str | os.PathLike[str], *, progress: Callable[[int, int], None] | None = None
    ) -> None:
        """Write the film.

        Parameters
        ----------
        path : path
            Its ending is the format: ``.html``, ``.gif`` or ``.mp4``.
        progress : callable, optional
            Called with the number of frames drawn so far, and of all.

        Raises
        ------
        InputError
            If the ending is another, ffmpeg is missing for ``.mp4``, or the path cannot be
            written.
        OSError
            If the writing fails.
        TypeError
            If ``path`` is no path, or ``progress`` no function.
        """
        path = check_film("path", path)
        check_outputs({"path": path}, {})
        function("progress", progress)
        if path.suffix.lower() == ".html":
            data = self.page.encode()
        else:
            data = self._animation(path.suffix.lower(), progress)
        with whole_file(path) as stream:
            stream.write(data)

    @cached_property
    def page(self) -> str:
        """The film as one page of HTML that needs no other file."""
        drawing = _Drawing(self)
        drawing.show(self.scenes[-1])  # which is without contact, often
        frames = [drawing.moved(scene) for scene in self.scenes]
        data = json.dumps(
            {"x": drawing.across, "top": drawing.top, "rate": _RATE, "frames": frames},
            separators=(",", ":"),
        )
        result, gamma = self.result, self.result.problem.work_of_adhesion
        name, work = "loop: loss", result.lost
        if isinstance(result, PathResult):
            name, work = "path: work", result.work
        jumps = counted(len(result.jumps), "jump")
        if (shown := self.jumps_shown) < len(result.jumps):
            jumps += f", of which the {shown} with the largest drops have frames of their own"
        parts = {
            "@SVG@": drawing.svg(),
            "@TITLE@": escape(f"{name} {work:.4g} J/m² at γ = {gamma:g} J/m²"),
            "@JUMPS@": escape(jumps),
            "@LAST@": str(len(self) - 1),
            "@DATA@": data.replace("<", "\\u003c"),
        }
        template = Path(__file__).with_name("film.html").read_text(encoding="utf-8")
        return re.sub("@[A-Z]+@", lambda found: parts[found[0]], template)

    def _animation(self, ending: str, progress: Callable[[int, int], None] | None) -> bytes:
        drawing = _Drawing(self)
        writer = PillowWriter(fps=_RATE) if ending == ".gif" else FFMpegWriter(fps=_RATE)
        with tempfile.TemporaryDirectory() as folder, style(), mpl.rc_context(_LOOK):
            file = Path(folder, f"film{ending}")
            drawing.freeze()
            with writer.saving(drawing.figure, str(file), dpi=_DPI):
                for number, scene in enumerate(self.scenes, 1):
                    drawing.show(scene, texts=True)
                    writer.grab_frame()
                    if progress is not None:
                        progress(number, len(self))
            return file.read_bytes()


class _Drawing:
    """The figure of a film, and what moves in it."""

    def __init__(self, film: Film) -> None:
        self._film = film
        with style(), mpl.rc_context(_LOOK):
            self.figure = new_figure(2, 1, _WIDTH, _HEIGHT, height_ratios=[3, 4])
            shape, curve = self.figure.axes
            self._draw_shape(shape)
            self._draw_curve(curve)
            self.figure.draw_without_rendering()  # finds the layout: the page needs coordinates
            self.figure.set_layout_engine("none")
        self._shape, self._curve = shape, curve
        self.across = [int(v) for v in self._tenths(shape, self._mm, 0 * self._mm)[0]]
        self.top = int(self._tenths(shape, self._mm[:1], np.array([self._ceiling]))[1][0])

    def _draw_shape(self, axes: Axes) -> None:
        x, height = self._film.x, 1e6 * self._film.height
        self._mm = 1e3 * x
        span = float(np.ptp(height))
        floor = height.min() - 0.05 * span
        top = 1e6 * max(float(scene.surface.max()) for scene in self._film.scenes)
        self._ceiling = min(top, floor + _MOST_RANGE * span) + 0.1 * span
        axes.fill_between(self._mm, height, floor, color="0.55", lw=0)
        blue: Any = {"fc": "#56B4E9", "ec": "#0072B2", "lw": 1.0, "alpha": 0.55}
        (self._body,) = axes.fill(self._mm, height, gid="film-body", **blue)
        red: Any = {"color": "#D55E00", "lw": 3.0, "solid_capstyle": "round"}
        (self._contact,) = axes.plot(self._mm[:2], height[:2], gid="film-contact", **red)
        axes.set(xlim=(self._mm[0], self._mm[-1]), ylim=(floor, self._ceiling))
        axes.set(xlabel="position (mm)", ylabel="height (µm)")
        title = "elastic body (blue) over the rigid profile (grey), contact in red"
        axes.set_title(title, loc="left")

    def _draw_curve(self, axes: Axes) -> None:
        result = self._film.result
        x, y = result.penetration, result.mean_stress / result.problem.stress_scale
        self._path = np.column_stack([x, y])
        for branch in ("loading", "unloading"):
            rows = np.where(result.branch == branch, y, np.nan)
            axes.plot(x, rows, color="k", ls=LINE_OF_BRANCH[branch], lw=1.0, label=branch)
        places = np.array(result.states_before_jumps(), dtype=int)
        axes.plot(x[places], y[places], "o", ms=3, mfc="#D55E00", mew=0, label="jumps")
        axes.axhline(0, color="0.7", lw=0.5, zorder=0)
        look: Any = {"ms": 8, "mfc": "#0072B2", "mec": "w", "gid": "film-point"}
        (self._point,) = axes.plot(x[:1], y[:1], "o", **look)
        axes.set(xlabel="penetration Δ/h_max", ylabel="σ~ = 2p̄/(E* q0 h_max)")
        axes.legend(loc="best")
        axes.set_title(" ")  # keeps the place of the texts
        above: Any = {"transform": axes.transAxes, "va": "bottom", "fontsize": 9}
        self._texts = axes.text(0, 1.02, "", **above), axes.text(1, 1.02, "", ha="right", **above)

    def freeze(self) -> None:
        """Make one picture of all that does not move: drawing it takes most of the time."""
        moving: tuple[Artist, ...] = (self._body, self._contact, self._point)
        for artist in moving:
            artist.set_visible(False)
        self.figure.set_dpi(_DPI)
        canvas: Any = FigureCanvasAgg(self.figure)
        canvas.draw()
        picture = np.asarray(canvas.buffer_rgba()).copy()
        for axes in self.figure.axes:
            for artist in axes.get_children():
                if artist not in (*moving, *self._texts):
                    artist.set_visible(False)
            axes.set_axis_off()
        for artist in moving:
            artist.set_visible(True)
        self.figure.figimage(picture, zorder=-1)

    def show(self, scene: Scene, *, texts: bool = False) -> None:
        """Move the figure to a frame; with its texts, which a page has beside the figure."""
        surface = 1e6 * scene.surface
        x = np.concatenate([self._mm, self._mm[::-1]])
        top = max(self._ceiling, float(surface.max()))
        self._body.set_xy(np.column_stack([x, np.concatenate([surface, 0 * surface + top])]))
        pieces = [np.array([[np.nan, np.nan]])]
        for left, right in 1e3 * scene.patches:
            inside = self._mm[(self._mm > left) & (self._mm < right)]
            piece = np.array([left, *inside, right])
            pieces += [np.column_stack([piece, np.interp(piece, self._mm, surface)]), pieces[0]]
        self._contact.set_data(*np.concatenate(pieces).T)
        self._point.set_data(*self._path[[scene.state]].T)
        if texts:
            caption, _, lost = scene.caption.partition("; ")
            self._texts[0].set_text(caption)
            self._texts[1].set_text(scene.announcement or lost)
            self._texts[1].set_color("#D55E00" if scene.announcement else "k")

    def moved(self, scene: Scene) -> dict[str, Any]:
        """Return what a page moves for a frame, in tenths of a point.

        ``y``: the surface at the positions ``x``, the first value and then differences; ``c``: ends
        of the contact patches in units of the spacing of ``x``, in thousandths; ``p``: the point.
        """
        _, y = self._tenths(self._shape, self._mm, 1e6 * scene.surface)
        point = self._tenths(self._curve, *self._path[[scene.state]].T)
        spacing = self._film.x[1]
        return {
            "y": [int(v) for v in np.diff(y, prepend=0)],
            "c": np.rint(1e3 * scene.patches / spacing).astype(int).ravel().tolist(),
            "p": [int(v[0]) for v in point],
            "s": scene.caption,
            "j": scene.announcement,
            "n": int(scene.is_notable),
        }

    def svg(self) -> str:
        """Return the figure as SVG, without its head."""
        stream = io.StringIO()
        with style(), mpl.rc_context(_LOOK):
            # an empty line has no path that could be moved
            self._contact.set_data(self._mm[:2], self._mm[:2])
            self.figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
        text = stream.getvalue()
        return text[text.index("<svg") :]

    def _tenths(self, axes: Axes, x: Array, y: Array) -> tuple[Array, Array]:
        """Return points of a panel in tenths of a point of the page, y downwards."""
        display = axes.transData.transform(np.column_stack([x, y])) * 72 / self.figure.dpi
        return np.rint(_TENTH * display[:, 0]), np.rint(_TENTH * (72 * _HEIGHT - display[:, 1]))
