"""Pictures of a run: the relative density on the deformed body, the energy ledger, the tips of the crack.

Drawn on matplotlib's Agg canvas, without pyplot, so that no display is needed and pictures share no state. The suffix
of the path decides on the format; vector formats hold the density as an image. Sizes are those of a journal page.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

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

from .output import replaced, write_atomic
from .space import Space

__all__ = ["GAMMA_MAP", "Frame", "animation", "comparison_picture", "density_picture", "ledger_picture",
           "live_elements", "tip_picture"]

History = Mapping[str, np.ndarray]  # as loaded by `output.History.load`

#: Colours of gamma from 0 (spent, black) to 1 (intact, pale grey); the lightness rises throughout.
GAMMA_MAP = LinearSegmentedColormap.from_list("relative density", [
    (0.0, "#0b0724"), (0.2, "#51127c"), (0.4, "#a5317e"), (0.6, "#e8605d"), (0.8, "#fdb57f"), (0.93, "#e9dccf"),
    (1.0, "#d3dae1")])
#: Bands of the ledger from the bottom up: what is lost (warm), then what is still there (cool).
BANDS = {"sink_stored": ("$D$, from stored energy", "#a63d40"), "sink_kinetic": ("$D$, from motion", "#e08e79"),
         "deletion": ("left in deleted elements", "#7a6c5d"), "released": ("released in relaxing", "#f2cc8f"),
         "kinetic": ("kinetic", "#86bbd8"), "elastic": ("elastic", "#33658a"), "numerical": ("numerical", "#444444")}
STYLE = {"font.family": "DejaVu Sans", "font.size": 8, "axes.titlesize": 8, "axes.labelsize": 8, "axes.linewidth": 0.6,
         "figure.titlesize": 9, "legend.fontsize": 7, "legend.frameon": False, "xtick.labelsize": 7,
         "ytick.labelsize": 7, "xtick.major.width": 0.6, "ytick.major.width": 0.6, "lines.linewidth": 1.2}
WIDTH, TALLEST = 7.2, 9.0   # of a picture [in]
DPI = 300
SPENT = 1e-2         # nodes with a lower gamma carry nothing: their displacement has no meaning and is not drawn
LONGEST = 3.0        # stretch of an edge beyond which an element is torn and not drawn
LEAST_PIECE = 0.02   # of the body; smaller fragments do not widen the axes
GIF_BYTES = 3_000_000

# nodes of an element are numbered lexicographically (see `space`); facets go round as seen from outside
_FACETS = {2: np.array([[0, 1], [1, 3], [3, 2], [2, 0]]),
           3: np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])}
_ROUND = [0, 1, 3, 2]
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
    """What is drawn of a frame: four-cornered faces from back to front.

    Attributes
    ----------
    corners: around the faces, in the plane of the picture [mm], (nf, 4, 2).   gamma: there, (nf, 4).
    light: brightness of the faces, (nf,).   outline: lines along the edge of the body [mm], (lines, 2, 2).
    box: least and greatest coordinates [mm], (2, 2).
    """

    corners: np.ndarray
    gamma: np.ndarray
    light: np.ndarray
    outline: np.ndarray
    box: np.ndarray


def live_elements(space: Space, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Elements to draw (nl,), and their corners on the deformed body [mm], (nl, na, dim).

    Left out are elements that are deleted, spent at every node, or torn apart. A spent node flies as it likes: each
    element draws it as if it had moved with the nodes that are not spent, so that the lips of a crack part cleanly.
    """
    holds = frame.gamma[space.conn] >= SPENT
    elements = np.flatnonzero(~frame.deleted & holds.any(axis=1))
    X, u, holds = space.X[space.conn[elements]], frame.u[space.conn[elements]], holds[elements][:, :, None]
    x = X + np.where(holds, u, np.sum(u, axis=1, where=holds, keepdims=True) / holds.sum(axis=1, keepdims=True))
    pairs = [(a, a | 1 << i) for i in range(space.dim) for a in range(2**space.dim) if not a >> i & 1]
    stretch = [np.linalg.norm(x[:, a] - x[:, b], axis=1) / np.linalg.norm(X[:, a] - X[:, b], axis=1) for a, b in pairs]
    whole = np.max(stretch, axis=0) < LONGEST
    return elements[whole], x[whole]


def _body(space: Space, frame: Frame, view: tuple[float, float]) -> _Body:
    elements, x = live_elements(space, frame)
    gamma = frame.gamma[space.conn[elements]]
    facets = _FACETS[space.dim]
    if space.dim == 3:
        x = x @ _axes_of(view).T
    box = _box(space, elements, x[:, :, :2], frame.gamma)
    if space.dim == 2:
        outline = x[:, facets][_outer(space, np.arange(space.n_elements))[elements]]
        return _Body(x[:, _ROUND], gamma[:, _ROUND], np.ones(len(x)), outline, box)
    surface = _outer(space, elements)
    x, gamma = x[:, facets][surface], gamma[:, facets][surface]
    normal = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    light = 0.65 + 0.35 * np.clip(normal @ _LIGHT / np.linalg.norm(normal, axis=1), 0, 1)
    seen = np.flatnonzero(normal[:, 2] > 0)
    seen = seen[np.argsort(x[seen, :, 2].mean(axis=1), kind="stable")]
    return _Body(x[seen, :, :2], gamma[seen], light[seen], np.zeros((0, 2, 2)), box)


def _outer(space: Space, elements: np.ndarray) -> np.ndarray:
    """Which facets of the elements, (nl, facets), are shared with no other of them."""
    nodes = np.sort(space.conn[elements][:, _FACETS[space.dim]], axis=2)
    key = nodes[:, :, :space.dim] @ space.n_nodes ** np.arange(space.dim)  # as many nodes as tell facets apart
    _, inverse, counts = np.unique(key, return_inverse=True, return_counts=True)
    return np.asarray(counts[inverse] == 1).reshape(key.shape)


def _box(space: Space, elements: np.ndarray, x: np.ndarray, gamma: np.ndarray) -> np.ndarray:
    """Least and greatest coordinates (2, 2) of the pieces of the body that are not small fragments."""
    conn = space.conn[elements]
    ends = np.arange(len(conn) + 1) * conn.shape[1]
    touches = csr_array((gamma[conn].ravel() >= SPENT, conn.ravel(), ends), shape=(len(conn), space.n_nodes))
    _, piece = connected_components((touches @ touches.T).astype(np.int8), directed=False)
    volume = np.bincount(piece, space.V[elements])
    kept = x[volume[piece] > LEAST_PIECE * volume.sum()].reshape(-1, 2)
    return np.array([kept.min(axis=0), kept.max(axis=0)])


def _axes_of(view: tuple[float, float]) -> np.ndarray:
    """Unit vectors to the right, up, and towards the observer, (3, 3); azimuth and elevation in degrees."""
    (ca, ce), (sa, se) = np.cos(np.radians(view)), np.sin(np.radians(view))
    return np.array([[-sa, ca, 0], [-ca * se, -sa * se, ce], [ca * ce, sa * ce, se]])


def _draw(ax: Axes, body: _Body, box: np.ndarray, flat: bool) -> None:
    """Draw a body into axes that show `box` [mm]: each face as four triangles about its centre, smoothly shaded."""
    points = np.concatenate([body.corners, body.corners.mean(axis=1, keepdims=True)], axis=1)
    gamma = np.concatenate([body.gamma, body.gamma.mean(axis=1, keepdims=True)], axis=1)
    fan = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    triangles = (5 * np.arange(len(points))[:, None, None] + fan).reshape(-1, 3)
    colour = GAMMA_MAP(np.clip(gamma, 0, 1))
    colour[:, :, :3] *= body.light[:, None, None]
    mesh = TriMesh(Triangulation(*points.reshape(-1, 2).T, triangles), rasterized=True, zorder=1)
    mesh.set_facecolor(colour.reshape(-1, 4))
    ax.add_collection(mesh, autolim=False)
    ax.add_collection(LineCollection(list(body.outline), colors="#555555", linewidths=0.4, zorder=2), autolim=False)
    margin = 0.02 * np.ptp(box, axis=0).max()
    ax.set(xlim=(box[0, 0] - margin, box[1, 0] + margin), ylim=(box[0, 1] - margin, box[1, 1] + margin), aspect="equal")
    if not flat:
        ax.set_axis_off()


def _panels(figure: Figure, axes: Sequence[Axes], bodies: Sequence[_Body], titles: Sequence[str], box: np.ndarray,
            flat: bool) -> None:
    """Bodies side by side at one scale, with their titles and a colour bar."""
    for ax, body, title in zip(axes, bodies, titles):
        _draw(ax, body, box, flat)
        ax.set(title=title, xlabel="$x$ (mm)", ylabel="$y$ (mm)")
        ax.label_outer()
    bar = figure.colorbar(ScalarMappable(cmap=GAMMA_MAP), ax=list(axes), aspect=25, pad=0.02, shrink=0.8)
    bar.set_label("relative density γ")
    bar.outline.set_linewidth(0.4)


def _common_box(bodies: Sequence[_Body]) -> tuple[np.ndarray, float, float]:
    """Least and greatest coordinates (2, 2) of all bodies, width and height [mm]."""
    box = np.array([np.min([b.box[0] for b in bodies], axis=0), np.max([b.box[1] for b in bodies], axis=0)])
    return box, *(box[1] - box[0])


@matplotlib.rc_context(STYLE)
def density_picture(space: Space, frames: Sequence[Frame], path: str | Path, title: str = "",
                    view: tuple[float, float] = (-75.0, 60.0)) -> None:
    """Relative density on the deformed body, a panel for each frame.

    `view` is the azimuth and elevation [degrees] from which a body in space is seen, without perspective.
    """
    bodies = [_body(space, frame, view) for frame in frames]
    box, width, height = _common_box(bodies)

    def panel(columns: int) -> float:
        """Width of a panel [in]."""
        rows = -(-len(frames) // columns)
        return min((WIDTH - 1.3) / columns - 0.1, ((TALLEST - 0.6) / rows - 0.3) * width / height)

    columns = max(range(1, len(frames) + 1), key=panel)
    rows = -(-len(frames) // columns)
    figure = Figure((WIDTH, rows * (panel(columns) * height / width + 0.3) + 0.6), layout="compressed")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax in axes[len(frames):]:
        ax.set_axis_off()
    _panels(figure, axes, bodies, [frame.title for frame in frames], box, space.dim == 2)
    _save(figure, path, title)


@matplotlib.rc_context(STYLE)
def animation(space: Space, frames: Sequence[Frame], path: str | Path, seconds: float = 7.0,
              view: tuple[float, float] = (-75.0, 60.0)) -> None:
    """Relative density on the deformed body as an endless GIF of about `seconds` and at most `GIF_BYTES`."""
    bodies = [_body(space, frame, view) for frame in frames]
    box, width, height = _common_box(bodies)
    duration = [max(20, int(1000 * seconds / (len(frames) + 5)))] * len(frames)
    duration[-1] *= 6  # the end stays for a while
    scale = 3.6 / max(width, height)
    for dpi in (110, 80, 60, 45):
        pictures = []
        for body, frame in zip(bodies, frames):
            figure = Figure((scale * width + 1.3, scale * height + 0.75), dpi=dpi, layout="compressed")
            _panels(figure, [figure.subplots()], [body], [frame.title], box, space.dim == 2)
            canvas = FigureCanvasAgg(figure)
            canvas.draw()
            pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3].copy()))
        sample = Image.fromarray(np.concatenate([np.asarray(p) for p in pictures[::max(1, len(pictures) // 4)]]))
        palette = sample.quantize(128)
        reduced = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
        file = io.BytesIO()
        reduced[0].save(file, "GIF", save_all=True, append_images=reduced[1:], duration=duration, loop=0)
        if file.tell() <= GIF_BYTES:
            break
    write_atomic(path, file.getvalue())


# --- curves ---
def _event(history: History) -> tuple[dict[str, np.ndarray], np.ndarray, str, str]:
    """Rows of the event, their times [µs] (or steps, where time stands still), the label of those, unit of energy."""
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
            style = {"hatch": "////", "facecolor": "none"} if name == "numerical" else {"facecolor": colour}
            ax.fill_between(time, total, total + event[name], label=meaning, edgecolor=colour, linewidth=0.2, **style)
            total = total + event[name]
    ax.plot(time, total, "k", label="total")
    ax.plot(time, event["U_paper"], "k--", label="$U$ of the paper")
    ax.set(ylabel=f"energy ({unit})", ylim=(0, None), xlim=(time[0], time[-1] if len(time) > 1 else time[0] + 1))
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], loc="outside right upper")
    onset = event["elastic"][0] + event["kinetic"][0]
    low.axhline(0, color="0.6", linewidth=0.6)
    low.plot(time, 100 * event["balance"] / onset, "k")
    low.set(xlabel=label, ylabel="balance error\n(% of onset)")
    figure.align_ylabels()
    _save(figure, path, title)


@matplotlib.rc_context(STYLE)
def tip_picture(history: History, path: str | Path, title: str = "", shear_wave_speed: float = np.nan,
                rayleigh_wave_speed: float = np.nan) -> None:
    """Where the leading tip is, and how fast, beside the wave speeds [m/s] and the number of branches."""
    event, time, label, _ = _event(history)
    figure = Figure((WIDTH / 2 + 0.6, 4.2), layout="constrained")
    ax, low = figure.subplots(2, 1, sharex=True)
    ax.plot(time, event["crack_length_mm"], "k", label="crack length")
    for name, style in (("x", "-"), ("y", "--"), ("z", ":")):
        if np.isfinite(event[f"tip_{name}_mm"]).any():
            ax.plot(time, event[f"tip_{name}_mm"], style, color=BANDS["elastic"][1], label=f"tip, ${name}$")
    ax.set(ylabel="length, position (mm)", ylim=(0, None))
    ax.legend()
    low.plot(time, event["tip_speed_m_per_s"], color=BANDS["sink_stored"][1])
    for speed, name in ((shear_wave_speed, "$c_s$"), (rayleigh_wave_speed, "$c_R$")):
        low.axhline(speed, color="0.3", linewidth=0.8, linestyle="-" if "s" in name else "--", label=name)
    low.set(xlabel=label, ylabel="tip speed (m/s)", ylim=(0, None))
    count = low.twinx()
    count.step(time, event["branches"], where="post", color=BANDS["kinetic"][1])
    count.set(ylabel="branches", ylim=(0, 3 * max(1, event["branches"].max())))
    count.yaxis.set_major_locator(MaxNLocator(integer=True))
    low.legend()
    figure.align_ylabels()
    _save(figure, path, title)


@matplotlib.rc_context(STYLE)
def comparison_picture(space: Space, dynamic_frame: Frame, quasistatic_frame: Frame, dyn_history: History,
                       qs_history: History, path: str | Path, title: str = "",
                       view: tuple[float, float] = (-75.0, 60.0)) -> None:
    """The dynamic crack beside the quasi-static one, and below where the energy of both is at the end."""
    bodies = [_body(space, frame, view) for frame in (dynamic_frame, quasistatic_frame)]
    box, width, height = _common_box(bodies)
    tall = min(2.9 * height / width, 5.0) + 0.5
    figure = Figure((WIDTH, tall + 2.2), layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=[tall, 2.2])
    names = [f"({letter}) {kind}{': ' * bool(frame.title)}{frame.title}" for letter, kind, frame in
             (("a", "dynamic", dynamic_frame), ("b", "quasi-static", quasistatic_frame))]
    _panels(top, top.subplots(1, 2), bodies, names, box, space.dim == 2)
    ax = bottom.subplots()
    groups = {"U_paper": "$U$ of\nthe paper", "sink_stored": "$D$, from\nstored energy", "sink_kinetic": "$D$, from\nmotion",
              "elastic": "elastic,\nleft", "kinetic": "kinetic,\nleft", "released": "released\nin relaxing"}
    for shift, history, kind, colour in ((-0.2, dyn_history, "dynamic", BANDS["elastic"][1]),
                                         (0.2, qs_history, "quasi-static", BANDS["released"][1])):
        last = [float(_event(history)[0][name][-1]) for name in groups]
        bars = ax.bar(np.arange(len(groups)) + shift, last, 0.38, label=kind, color=colour, edgecolor="k", linewidth=0.4)
        ax.bar_label(bars, fmt="%.3g", fontsize=6, padding=1)
    ax.set_xticks(range(len(groups)), list(groups.values()))
    ax.set(ylabel=f"energy ({_event(dyn_history)[3]})", title="(c) energies at the end")
    ax.margins(y=0.15)
    ax.legend()
    _save(figure, path, title)


def _save(figure: Figure, path: str | Path, title: str) -> None:
    if title:
        figure.suptitle(title)
    kind = Path(path).suffix.lstrip(".") or "png"
    with replaced(path) as part:
        figure.savefig(part, format=kind, dpi=DPI, metadata={"CreationDate": None} if kind == "pdf" else None)
