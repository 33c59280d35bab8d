"""Pictures of a run: the relative density on the deformed body, the energy ledger, the tips of the crack.

Drawn on matplotlib's Agg canvas without pyplot: no display is needed, and pictures share no state. The suffix of the
path decides on the format; in vector formats the density is an image. Sizes are those of a journal page.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, TriMesh
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation
from PIL import Image
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from .crack import CRACKED
from .output import replaced, write_atomic
from .space import Space

__all__ = ["GAMMA_MAP", "Frame", "animation", "comparison_picture", "density_picture", "ledger_picture",
           "live_elements", "tip_picture"]

History = Mapping[str, np.ndarray]  # columns, as `output.History.load` gives them
View = tuple[float, float]          # azimuth and elevation [degrees] from which a body in space is seen
OBLIQUE = (-75.0, 60.0)

#: Colours of gamma from 0 (nearly black) to 1 (intact, pale grey); the lightness rises throughout.
GAMMA_MAP = LinearSegmentedColormap.from_list("relative density", [
    (0.0, "#0b0724"), (0.2, "#51127c"), (0.4, "#a5317e"), (0.6, "#e8605d"), (0.8, "#fdb57f"), (0.93, "#e9dccf"),
    (1.0, "#d3dae1")])
#: Bands of the ledger from the bottom up: what is lost (warm), then what is still there (cool).
BANDS = {"sink_stored": ("$D$, from stored energy", "#a63d40"), "sink_kinetic": ("$D$, from motion", "#e08e79"),
         "deletion": ("left in deleted elements", "#7a6c5d"), "released": ("released in relaxing", "#f2cc8f"),
         "kinetic": ("kinetic", "#86bbd8"), "elastic": ("elastic", "#33658a"), "numerical": ("numerical", "#9b9b9b")}
RED, BLUE, SAND = (BANDS[name][1] for name in ("sink_stored", "elastic", "released"))
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans", "font.size": 8, "axes.titlesize": 8, "axes.labelsize": 8, "axes.linewidth": 0.6,
    "figure.titlesize": 9, "legend.fontsize": 7, "legend.frameon": False, "xtick.labelsize": 7, "ytick.labelsize": 7,
    "xtick.major.width": 0.6, "ytick.major.width": 0.6, "lines.linewidth": 1.2}
WIDTH, TALLEST = 7.2, 9.0  # of a picture [in]
DPI = 300
GIF_BYTES = 3_000_000
SPENT = 1e-2        # nodes with a lower gamma carry nothing, and their displacement has no meaning
LONGEST = 3.0       # stretch of an edge beyond which an element is torn
LEAST_PIECE = 0.02  # of the body; smaller fragments do not widen the axes

# nodes of an element are numbered lexicographically (see `space`); facets go round as seen from outside
_FACETS = {2: np.array([[0, 1], [1, 3], [3, 2], [2, 0]]),
           3: np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])}
_LIGHT = np.array([-0.3, 0.4, 0.87])  # towards the light: right, up, out of the picture


@dataclass(frozen=True)
class Frame:
    """The fields at one time.

    Attributes
    ----------
    time: [s]; NaN where time means nothing.   label: what happens then; may be empty.
    u: displacement [mm], (n, dim).   gamma: relative density, (n,).   deleted: failed elements, (ne,) bool.
    """

    time: float
    label: str
    u: np.ndarray
    gamma: np.ndarray
    deleted: np.ndarray

    @property
    def title(self) -> str:
        """Label and time in microseconds."""
        return ", ".join(filter(None, [self.label, f"{self.time * 1e6:.1f} µs" if np.isfinite(self.time) else ""]))


# --- the deformed body ---
@dataclass(frozen=True)
class _Body:
    """A frame as it is drawn: triangles from back to front with x, y [mm], gamma and brightness of their corners,
    (nt, 3, 4); lines along the edge of the body [mm], (lines, 2, 2); least and greatest x, y [mm], (2, 2)."""

    triangles: np.ndarray
    outline: np.ndarray
    box: np.ndarray


def live_elements(space: Space, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Elements to draw (nl,), and their corners on the deformed body [mm], (nl, na, dim).

    Left out are elements that are deleted, spent at every node, or torn apart. A spent node flies as it likes: each
    element has it move with the nodes that are not spent, so that the lips of a crack part cleanly.
    """
    holds = frame.gamma[space.conn] >= SPENT
    elements = np.flatnonzero(~frame.deleted & holds.any(axis=1))
    X, u, holds = space.X[space.conn[elements]], frame.u[space.conn[elements]], holds[elements][:, :, None]
    x = X + np.where(holds, u, np.sum(u, axis=1, where=holds, keepdims=True) / holds.sum(axis=1, keepdims=True))
    pairs = [(a, a | 1 << i) for i in range(space.dim) for a in range(2**space.dim) if not a >> i & 1]
    stretch = [np.linalg.norm(x[:, a] - x[:, b], axis=1) / np.linalg.norm(X[:, a] - X[:, b], axis=1) for a, b in pairs]
    whole = np.max(stretch, axis=0) < LONGEST
    return elements[whole], x[whole]


def _body(space: Space, frame: Frame, view: View) -> _Body:
    elements, x = live_elements(space, frame)
    gamma, facets = frame.gamma[space.conn[elements]], _FACETS[space.dim]
    if space.dim == 2:
        outline = x[:, facets][_outer(space, np.arange(space.n_elements))[elements]]
        faces = np.dstack([x, gamma, np.ones_like(gamma)])[:, [0, 1, 3, 2]]
        return _Body(_triangles(faces), outline, _box(space, elements, x, gamma))
    (ca, ce), (sa, se) = np.cos(np.radians(view)), np.sin(np.radians(view))
    x = x @ np.array([[-sa, ca, 0], [-ca * se, -sa * se, ce], [ca * ce, sa * ce, se]]).T  # right, up, to the observer
    box, surface = _box(space, elements, x[:, :, :2], gamma), _outer(space, elements)
    x, gamma = x[:, facets][surface], gamma[:, facets][surface]
    normal = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    light = 0.65 + 0.35 * np.clip(normal @ _LIGHT / np.linalg.norm(normal, axis=1), 0, 1)
    faces = np.dstack([x[:, :, :2], gamma, np.broadcast_to(light[:, None], gamma.shape)])
    seen = np.flatnonzero(normal[:, 2] > 0)
    return _Body(_triangles(faces[seen[np.argsort(x[seen, :, 2].mean(axis=1))]]), np.zeros((0, 2, 2)), box)


def _triangles(faces: np.ndarray) -> np.ndarray:
    """Four triangles about the centre of each face (nf, 4, 4), cut off where gamma falls below `CRACKED`."""
    centre = np.broadcast_to(faces.mean(axis=1, keepdims=True), faces.shape)
    fan = np.stack([faces, np.roll(faces, -1, axis=1), centre], axis=2).reshape(-1, 3, 4)
    above = fan[:, :, 2] >= CRACKED
    count = above.sum(axis=1)
    first = np.where(count == 1, above.argmax(axis=1), above.argmin(axis=1))  # the corner unlike the two others
    a, b, c = (fan[np.arange(len(fan)), (first + k) % 3] for k in range(3))
    with np.errstate(divide="ignore", invalid="ignore"):
        ab, ac = (a + (b_ - a) * ((CRACKED - a[:, 2]) / (b_ - a)[:, 2])[:, None] for b_ in (b, c))
    one, two = count == 1, count == 2
    kept = [fan[count == 3], np.stack([a, ab, ac], axis=1)[one], np.stack([ab, b, c], axis=1)[two],
            np.stack([ab, c, ac], axis=1)[two]]
    order = np.concatenate([np.flatnonzero(which) for which in (count == 3, one, two, two)])
    return np.concatenate(kept)[np.argsort(order, kind="stable")]


def _outer(space: Space, elements: np.ndarray) -> np.ndarray:
    """Which facets of the elements, (nl, facets), are shared with no other of them."""
    nodes = np.sort(space.conn[elements][:, _FACETS[space.dim]], axis=2)
    key = nodes[:, :, :space.dim] @ space.n_nodes ** np.arange(space.dim)  # as many nodes as tell facets apart
    _, inverse, counts = np.unique(key, return_inverse=True, return_counts=True)
    return np.asarray(counts[inverse] == 1).reshape(key.shape)


def _box(space: Space, elements: np.ndarray, x: np.ndarray, gamma: np.ndarray) -> np.ndarray:
    """Least and greatest x, y (2, 2) of the pieces of the body that are not small fragments."""
    conn = space.conn[elements]
    touches = csr_array(((gamma >= SPENT).ravel().astype(np.int8), conn.ravel(), np.arange(len(conn) + 1) * len(conn.T)),
                        shape=(len(conn), space.n_nodes))
    _, piece = connected_components(touches @ touches.T, directed=False)
    volume = np.bincount(piece, space.V[elements])
    kept = x[volume[piece] > LEAST_PIECE * volume.sum()].reshape(-1, 2)
    return np.array([kept.min(axis=0), kept.max(axis=0)])


def _common_box(bodies: Sequence[_Body]) -> tuple[np.ndarray, float, float]:
    """Least and greatest x, y (2, 2) of all bodies with a margin, width and height [mm]."""
    box = np.array([np.min([b.box[0] for b in bodies], axis=0), np.max([b.box[1] for b in bodies], axis=0)])
    box += 0.02 * np.ptp(box, axis=0).max() * np.array([[-1], [1]])
    return box, *np.ptp(box, axis=0).tolist()


def _draw(ax: Axes, body: _Body, title: str) -> None:
    points = body.triangles.reshape(-1, 4)
    colour = GAMMA_MAP(np.clip(points[:, 2], 0, 1))
    colour[:, :3] *= points[:, 3:]
    mesh = TriMesh(Triangulation(points[:, 0], points[:, 1], np.arange(len(points)).reshape(-1, 3)), rasterized=True)
    mesh.set_facecolor(colour)
    ax.add_collection(mesh, autolim=False)
    ax.add_collection(LineCollection(list(body.outline), colors="0.35", linewidths=0.4), autolim=False)
    ax.set_title(title)


def _panels(axes: Sequence[Axes], bodies: Sequence[_Body], titles: Sequence[str], box: np.ndarray, dim: int) -> None:
    """Bodies at one scale, with titles and a colour bar."""
    for ax, body, title in zip(axes, bodies, titles):
        _draw(ax, body, title)
        ax.set(xlim=box[:, 0], ylim=box[:, 1], aspect="equal", xlabel="$x$ (mm)", ylabel="$y$ (mm)")
        ax.locator_params(nbins=5)
        ax.label_outer()
        if dim == 3:
            ax.set_axis_off()
    bar = axes[0].figure.colorbar(ScalarMappable(cmap=GAMMA_MAP), ax=axes, aspect=25, pad=0.02, shrink=0.8)
    bar.set_label(r"relative density $\gamma$")


@matplotlib.rc_context(STYLE)
def density_picture(space: Space, frames: Sequence[Frame], path: str | Path, title: str = "",
                    view: View = OBLIQUE) -> None:
    """Relative density on the deformed body, a panel for each frame; cracks (gamma < 0.1) are open."""
    bodies = [_body(space, frame, view) for frame in frames]
    box, width, height = _common_box(bodies)
    n = len(frames)
    grids = {c: min((WIDTH - 1.3) / c - 0.1, ((TALLEST - 0.6) * c / n - 0.3) * width / height)  # width of a panel [in]
             for c in range(1, n + 1) if n % c == 0}
    columns = max(c for c, panel in grids.items() if panel > 0.7 * max(grids.values()))
    figure = Figure((WIDTH, n // columns * (grids[columns] * height / width + 0.3) + 0.6), layout="compressed")
    axes = figure.subplots(n // columns, columns, squeeze=False).ravel().tolist()
    _panels(axes, bodies, [frame.title for frame in frames], box, space.dim)
    _save(figure, path, title)


@matplotlib.rc_context(STYLE)
def animation(space: Space, frames: Sequence[Frame], path: str | Path, seconds: float = 7.0,
              view: View = OBLIQUE) -> None:
    """Relative density on the deformed body as an endless GIF of about `seconds` and at most `GIF_BYTES`."""
    bodies = [_body(space, frame, view) for frame in frames]
    box, width, height = _common_box(bodies)
    duration = [max(20, int(1000 * seconds / (len(frames) + 5)))] * len(frames)
    duration[-1] *= 6  # the end stays for a while
    scale = 3.6 / max(width, height)
    for dpi in (120, 90, 60, 40):
        figure = Figure((scale * width + 1.3, scale * height + 0.75), dpi=dpi, layout="compressed")
        canvas, ax = FigureCanvasAgg(figure), figure.subplots()
        _panels([ax], bodies[-1:], [frames[-1].title], box, space.dim)
        canvas.draw()
        figure.set_layout_engine("none")
        pictures = []
        for body, frame in zip(bodies, frames):
            for artist in list(ax.collections):
                artist.remove()
            _draw(ax, body, frame.title)
            canvas.draw()
            pictures.append(np.asarray(canvas.buffer_rgba())[:, :, :3].copy())
        palette = Image.fromarray(np.concatenate(pictures[::max(1, len(pictures) // 4)])).quantize(128)
        images = [Image.fromarray(p).quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
        file = io.BytesIO()
        images[0].save(file, "GIF", save_all=True, append_images=images[1:], duration=duration, loop=0)
        if file.tell() <= GIF_BYTES:
            break
    write_atomic(path, file.getvalue())


# --- curves ---
def _event(history: History) -> tuple[dict[str, np.ndarray], np.ndarray, str, str]:
    """Rows of the event; their times [µs], or steps where time stands still; the label of these; the unit of energy."""
    rows = np.flatnonzero(history["phase"] == "event")
    if not rows.size:
        raise ValueError("the history has no rows of the event")
    event = {name: values[rows] for name, values in history.items()}
    unit = "N mm" if np.isfinite(history["tip_z_mm"]).any() else "N mm/mm"
    if np.ptp(event["time_s"]) > 0:
        return event, event["time_s"] * 1e6, "time since onset (µs)", unit
    return event, event["step"].astype(float), "sweep", unit


@matplotlib.rc_context(STYLE)
def ledger_picture(history: History, path: str | Path, title: str = "") -> None:
    """Where the energy is during the event, stacked so that the top edge is the total; below, what does not add up."""
    event, time, label, unit = _event(history)
    figure = Figure((WIDTH, 4.2), layout="constrained")
    ax, low = figure.subplots(2, 1, sharex=True, height_ratios=[4, 1])
    total = np.zeros(len(time))
    for name, (meaning, colour) in BANDS.items():
        if np.any(event[name]):
            ax.fill_between(time, total, total + event[name], label=meaning, color=colour, linewidth=0)
            total = total + event[name]
    ax.plot(time, total, "k", label="total")
    ax.plot(time, event["U_paper"], "k--", label="$U$ of the paper")
    ax.set(ylabel=f"energy ({unit})", ylim=(0, None))
    ax.margins(x=0)
    figure.legend(*(entry[::-1] for entry in ax.get_legend_handles_labels()), loc="outside right upper")
    onset = event["elastic"][0] + event["kinetic"][0]
    error = 100 * event["balance"] / onset
    limit = max(0.01, 1.2 * np.abs(error).max())
    low.plot(time, error, "k")
    low.set(xlabel=label, ylabel="balance error\n(% of onset)", ylim=(-limit, limit))
    figure.align_ylabels()
    _save(figure, path, title)


@matplotlib.rc_context(STYLE)
def tip_picture(history: History, path: str | Path, title: str, shear_wave_speed: float,
                rayleigh_wave_speed: float) -> None:
    """Where the leading tip is, and how fast, beside the wave speeds [m/s] and the number of branches."""
    event, time, label, _ = _event(history)
    figure = Figure((WIDTH / 2 + 0.6, 4.2), layout="constrained")
    ax, low = figure.subplots(2, 1, sharex=True)
    ax.plot(time, event["crack_length_mm"], "k", label="crack length")
    for name, line in (("x", "-"), ("y", "--"), ("z", ":")):
        if np.isfinite(event[f"tip_{name}_mm"]).any():
            ax.plot(time, event[f"tip_{name}_mm"], line, color=BLUE, label=f"tip, ${name}$")
    ax.set(ylabel="length, position (mm)")
    ax.margins(x=0)
    ax.legend()
    low.plot(time, event["tip_speed_m_per_s"], color=RED)
    for speed, name, line, align in ((shear_wave_speed, "$c_s$", "-", "bottom"), (rayleigh_wave_speed, "$c_R$", "--", "top")):
        low.axhline(speed, color="0.3", linewidth=0.8, linestyle=line)
        low.text(0.99, speed, name, transform=low.get_yaxis_transform(), ha="right", va=align)
    low.set(xlabel=label, ylim=(0, None))
    low.set_ylabel("tip speed (m/s)", color=RED)
    count = low.twinx()
    count.step(time, event["branches"], where="post", color=BLUE)
    count.set_ylim(0, 3 * max(2, event["branches"].max()))  # in the lower third, clear of the speed
    count.set_ylabel("branches", color=BLUE)
    count.yaxis.set_major_locator(MaxNLocator(6, integer=True))
    _save(figure, path, title)


@matplotlib.rc_context(STYLE)
def comparison_picture(space: Space, dynamic_frame: Frame, quasistatic_frame: Frame, dyn_history: History,
                       qs_history: History, path: str | Path, title: str = "", view: View = OBLIQUE) -> None:
    """The dynamic crack beside the quasi-static one, and below them where the energy of both is at the end."""
    bodies = [_body(space, frame, view) for frame in (dynamic_frame, quasistatic_frame)]
    box, width, height = _common_box(bodies)
    tall = min(2.9 * height / width, 6.0)
    figure = Figure((WIDTH, tall + 3.0), layout="constrained")
    axes = figure.subplot_mosaic([["a", "b"], ["c", "c"]], height_ratios=[tall, 1.9])
    names = [": ".join(filter(None, [kind, frame.title])) for kind, frame in
             (("(a) dynamic", dynamic_frame), ("(b) quasi-static", quasistatic_frame))]
    _panels([axes["a"], axes["b"]], bodies, names, box, space.dim)
    groups = {"U_paper": "$U$ of\nthe paper", "sink_stored": "$D$, from\nstored energy", "elastic": "elastic,\nleft",
              "sink_kinetic": "$D$, from\nmotion", "kinetic": "kinetic,\nleft", "released": "released\nin relaxing"}
    for shift, history, kind, colour in ((-0.2, dyn_history, "dynamic", BLUE), (0.2, qs_history, "quasi-static", SAND)):
        event, _, _, unit = _event(history)
        bars = axes["c"].bar(np.arange(len(groups)) + shift, [event[name][-1] for name in groups], 0.38, label=kind,
                             color=colour, edgecolor="k", linewidth=0.4)
        axes["c"].bar_label(bars, fmt="%.3g", fontsize=6, padding=1)
    axes["c"].set(ylabel=f"energy ({unit})", title="(c) energies at the end")
    axes["c"].set_xticks(range(len(groups)), list(groups.values()))
    axes["c"].margins(y=0.15)
    axes["c"].legend()
    _save(figure, path, title)


def _save(figure: Figure, path: str | Path, title: str) -> None:
    figure.suptitle(title or None)
    kind = Path(path).suffix.lstrip(".") or "png"
    with replaced(path) as part:
        figure.savefig(part, format=kind, dpi=DPI, metadata={"CreationDate": None} if kind == "pdf" else None)
