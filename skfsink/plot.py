"""Pictures of a run: the relative density on the deformed body, the energy ledger, the tips of the crack.

Drawn on matplotlib's Agg canvas without pyplot: no display is needed, and pictures share no state. The suffix of the
path decides on the format; in vector formats the density is an image. Sizes are those of a journal page.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, TriMesh
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
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
WIDTH, TALLEST, DPI = 7.2, 9.0, 300  # size of a picture [in], dots per inch
GIF_FRAMES = 60     # at the most, less than 3 MB
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
class _Body(NamedTuple):
    """A frame as it is drawn."""

    triangles: np.ndarray  # from back to front: x, y [mm], gamma and brightness of their corners, (nt, 3, 4)
    outline: np.ndarray    # lines along the edge of a plane body [mm], (lines, 2, 2)
    box: np.ndarray        # least and greatest x, y [mm], (2, 2)


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


def _bodies(space: Space, frames: Sequence[Frame], view: View) -> tuple[list[_Body], np.ndarray, float]:
    """What to draw of the frames, the limits of the axes [mm] with a margin, (2, 2), and their height over width."""
    bodies = [_body(space, frame, view) for frame in frames]
    box = np.array([np.min([b.box[0] for b in bodies], axis=0), np.max([b.box[1] for b in bodies], axis=0)])
    box += 0.02 * np.ptp(box, axis=0).max() * np.array([[-1], [1]])
    width, height = box[1] - box[0]
    return bodies, box, float(height / width)


def _body(space: Space, frame: Frame, view: View) -> _Body:
    elements, x = live_elements(space, frame)
    gamma, facets = frame.gamma[space.conn[elements]], _FACETS[space.dim]
    if space.dim == 2:
        edge = _outer(space, np.arange(space.n_elements))[elements] & (gamma[:, facets].min(axis=2) >= CRACKED)
        faces = np.dstack([x, gamma, np.ones_like(gamma)])[:, [0, 1, 3, 2]]
        return _Body(_triangles(faces), x[:, facets][edge], _box(space, elements, x, gamma))
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
    whole, rim = np.flatnonzero(count == 3), np.flatnonzero(count % 3)
    one = count[rim] == 1
    first = np.where(one, above[rim].argmax(axis=1), above[rim].argmin(axis=1))  # the corner unlike the two others
    a, b, c = (fan[rim, (first + k) % 3] for k in range(3))
    ab, ac = (a + (end - a) * (CRACKED - a[:, 2:3]) / (end - a)[:, 2:3] for end in (b, c))
    kept = [fan[whole], *(np.stack(corners, axis=1)[mask] for corners, mask in
                          (((a, ab, ac), one), ((ab, b, c), ~one), ((ab, c, ac), ~one)))]
    order = np.concatenate([whole, rim[one], rim[~one], rim[~one]])
    return np.concatenate(kept)[np.argsort(order, kind="stable")]


def _outer(space: Space, elements: np.ndarray) -> np.ndarray:
    """Which facets of the elements, (nl, facets), are shared with no other of them."""
    nodes = np.sort(space.conn[elements][:, _FACETS[space.dim]], axis=2)
    key = nodes[:, :, :space.dim] @ space.n_nodes ** np.arange(space.dim)  # as many nodes as tell facets apart
    _, inverse, counts = np.unique(key, return_inverse=True, return_counts=True)
    return np.asarray(counts[inverse] == 1).reshape(key.shape)


def _box(space: Space, elements: np.ndarray, x: np.ndarray, gamma: np.ndarray) -> np.ndarray:
    """Least and greatest x, y (2, 2) of the pieces of the body that are not small fragments."""
    element, corner = np.nonzero(gamma >= SPENT)
    touches = csr_array((np.ones(len(element), np.int8), (element, space.conn[elements[element], corner])))
    _, piece = connected_components(touches @ touches.T, directed=False)
    volume = np.bincount(piece, space.V[elements])
    kept = x[volume[piece] > LEAST_PIECE * volume.sum()].reshape(-1, 2)
    return np.array([kept.min(axis=0), kept.max(axis=0)])


def _draw(ax: Axes, body: _Body, title: str) -> None:
    points = body.triangles.reshape(-1, 4)
    colour = GAMMA_MAP(np.clip(points[:, 2], 0, 1))
    colour[:, :3] *= points[:, 3:]
    mesh = TriMesh(Triangulation(points[:, 0], points[:, 1], np.arange(len(points)).reshape(-1, 3)), rasterized=True)
    mesh.set_facecolor(colour)
    ax.add_collection(mesh, autolim=False)
    ax.add_collection(LineCollection(list(body.outline), colors="0.35", linewidths=0.4), autolim=False)
    ax.set_title(title)


def _panels(axes: Sequence[Axes], bodies: Sequence[_Body], titles: Sequence[str], box: np.ndarray) -> None:
    """Bodies at one scale, with titles and a colour bar."""
    for ax, body, title in zip(axes, bodies, titles):
        _draw(ax, body, title)
        ax.set(xlim=box[:, 0], ylim=box[:, 1], aspect="equal", xlabel="$x$ (mm)", ylabel="$y$ (mm)")
        ax.locator_params(nbins=5)
        if not len(body.outline):  # a body in space: the axes of the picture are not those of the body
            ax.set_axis_off()
    bar = axes[0].figure.colorbar(ScalarMappable(cmap=GAMMA_MAP), ax=axes, aspect=25, pad=0.02, shrink=0.8)
    bar.set_label(r"relative density $\gamma$")


# --- pictures of the density ---
@matplotlib.rc_context(STYLE)
def density_picture(space: Space, frames: Sequence[Frame], path: str | Path, title: str = "",
                    view: View = OBLIQUE) -> None:
    """Relative density on the deformed body, a panel for each frame; cracks (gamma < 0.1) stand open."""
    bodies, box, ratio = _bodies(space, frames, view)
    n = len(frames)
    panel = {columns: min((WIDTH - 1.3) / columns - 0.1, ((TALLEST - 0.6) * columns / n - 0.3) / ratio)  # width [in]
             for columns in range(1, n + 1) if n % columns == 0}
    columns = max(c for c in panel if panel[c] > 0.6 * max(panel.values()))
    figure = Figure((WIDTH, n // columns * (panel[columns] * ratio + 0.3) + 0.6), layout="compressed")
    axes = figure.subplots(n // columns, columns, squeeze=False).ravel().tolist()
    _panels(axes, bodies, [frame.title for frame in frames], box)
    for ax in axes:
        ax.label_outer()
    _save(figure, path, title)


@matplotlib.rc_context(STYLE)
def animation(space: Space, frames: Sequence[Frame], path: str | Path, seconds: float = 7.0,
              view: View = OBLIQUE) -> None:
    """Relative density on the deformed body as an endless GIF of about `seconds`, of `GIF_FRAMES` at the most."""
    frames = [frames[i] for i in np.unique(np.linspace(0, len(frames) - 1, min(len(frames), GIF_FRAMES)).astype(int))]
    last, box, ratio = _bodies(space, frames[::-8], view)
    scale = 3.6 / max(1, ratio)
    figure = Figure((scale + 1.3, scale * ratio + 0.75), dpi=120, layout="compressed")
    canvas, ax = FigureCanvasAgg(figure), figure.subplots()
    _panels([ax], last[:1], [frames[-1].title], box)
    canvas.draw()
    figure.set_layout_engine("none")  # keep this layout for all frames
    pictures = []
    for frame in frames:
        for artist in list(ax.collections):
            artist.remove()
        _draw(ax, _body(space, frame, view), frame.title)
        canvas.draw()
        pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    palette = Image.fromarray(np.concatenate([*map(np.asarray, pictures[::max(1, len(pictures) // 4)])])).quantize(128)
    images = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    duration = [max(20, int(1000 * seconds / (len(frames) + 5)))] * len(frames)
    duration[-1] *= 6  # the end stays for a while
    file = io.BytesIO()
    images[0].save(file, "GIF", save_all=True, append_images=images[1:], duration=duration, loop=0)
    write_atomic(path, file.getvalue())


@matplotlib.rc_context(STYLE)
def comparison_picture(space: Space, dynamic_frame: Frame, quasistatic_frame: Frame, dyn_history: History,
                       qs_history: History, path: str | Path, title: str = "", view: View = OBLIQUE) -> None:
    """The dynamic crack beside the quasi-static one, and below them where the energy of both is at the end."""
    bodies, box, ratio = _bodies(space, (dynamic_frame, quasistatic_frame), view)
    tall = min(2.9 * ratio, 6.0)
    figure = Figure((WIDTH, tall + 2.9), layout="constrained")
    axes = figure.subplot_mosaic([["a", "b"], ["c", "c"]], height_ratios=[tall, 1.9])
    names = [f"(a) dynamic {dynamic_frame.title}", f"(b) quasi-static {quasistatic_frame.title}"]
    _panels([axes["a"], axes["b"]], bodies, names, box)
    axes["b"].set_ylabel("")
    bars = axes["c"]
    groups = {"U_paper": "$U$ of\nthe paper", "sink_stored": "$D$, from\nstored energy",
              "sink_kinetic": "$D$, from\nmotion", "released": "released\nin relaxing", "kinetic": "kinetic,\nleft",
              "elastic": "elastic,\nleft"}
    for shift, history, kind, colour in ((-0.2, dyn_history, "dynamic", BLUE), (0.2, qs_history, "quasi-static", SAND)):
        event, _, _, unit = _event(history)
        last = np.array([event[name][-1] for name in groups])
        last[np.abs(last) < 1e-4 * np.abs(last).max()] = 0.0
        drawn = bars.bar(np.arange(len(last)) + shift, last, 0.38, label=kind, color=colour, ec="k", linewidth=0.4)
        bars.bar_label(drawn, fmt="%.3g", fontsize=6, padding=1)
    bars.set(ylabel=f"energy ({unit})", title="(c) energies at the end", ymargin=0.15)
    bars.set_xticks(range(len(groups)), list(groups.values()))
    bars.legend()
    _save(figure, path, title)


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
    ax, low = figure.subplots(2, 1, sharex=True, height_ratios=[4, 1], subplot_kw={"xmargin": 0})
    total = np.zeros(len(time))
    for name, (meaning, colour) in BANDS.items():
        if np.any(event[name]):
            ax.fill_between(time, total, total + event[name], label=meaning, color=colour, linewidth=0)
            total = total + event[name]
    ax.plot(time, total, "k", label="total")
    ax.plot(time, event["U_paper"], "k--", label="$U$ of the paper")
    ax.set(ylabel=f"energy ({unit})", ylim=(0, None))
    figure.legend(*(entry[::-1] for entry in ax.get_legend_handles_labels()), loc="outside right upper")
    error = 100 * event["balance"] / (event["elastic"][0] + event["kinetic"][0])
    limit = max(0.01, 1.2 * np.abs(error).max())
    low.plot(time, error, "k")
    low.set(xlabel=label, ylabel="balance error\n(% of onset)", ylim=(-limit, limit))
    figure.align_ylabels()
    _save(figure, path, title)


@matplotlib.rc_context(STYLE)
def tip_picture(history: History, path: str | Path, title: str, shear_wave_speed: float,
                rayleigh_wave_speed: float) -> None:
    """Where the leading tip is, how fast beside the wave speeds [m/s] (if finite), and the number of branches."""
    event, time, label, _ = _event(history)
    figure = Figure((WIDTH / 2 + 0.6, 4.2), layout="constrained")
    ax, low = figure.subplots(2, 1, sharex=True, subplot_kw={"xmargin": 0})
    ax.plot(time, event["crack_length_mm"], "k", label="crack length")
    for name, line in (("x", "-"), ("y", "--"), ("z", ":")):
        if np.isfinite(event[f"tip_{name}_mm"]).any():
            ax.plot(time, event[f"tip_{name}_mm"], line, color=BLUE, label=f"tip, ${name}$")
    ax.set_ylabel("length, position (mm)")
    ax.legend()
    low.set_xlabel(label)
    count = low
    if np.isfinite(shear_wave_speed):
        speed = event["tip_speed_m_per_s"]
        low.plot(time, speed, color=RED)
        low.axhline(shear_wave_speed, color="0.3", linewidth=0.8, label="$c_s$")
        low.axhline(rayleigh_wave_speed, color="0.3", linewidth=0.8, linestyle="--", label="$c_R$")
        low.set_ylim(0, 1.2 * np.nanmax([shear_wave_speed, *speed]))
        low.set_ylabel("tip speed (m/s)", color=RED)
        low.legend(loc="upper right", ncols=2)
        count = low.twinx()
    count.step(time, event["branches"], where="post", color=BLUE)
    count.set(xmargin=0, ylim=(0, 3 * max(2, event["branches"].max())))  # in the lower third, clear of the speed
    count.set_ylabel("branches", color=BLUE)
    count.locator_params(axis="y", nbins=6, integer=True)
    _save(figure, path, title)


def _save(figure: Figure, path: str | Path, title: str) -> None:
    figure.suptitle(title)
    kind = Path(path).suffix.lstrip(".") or "png"
    with replaced(path) as part:
        figure.savefig(part, format=kind, dpi=DPI, metadata={"CreationDate": None} if kind == "pdf" else None)
