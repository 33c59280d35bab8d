"""Pictures of a run: the relative density on the deformed body, the energy ledger, the tips of the crack.

Drawn on matplotlib's Agg canvas without pyplot: no display is needed, and pictures share no state. The suffix of the
path decides on the format; in vector formats the density is an image. Sizes are those of a journal page.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, TriMesh
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from ..fem.space import Space
from ..fields.energy import OPTIONAL_TERMS
from ..results.frame import Frame
from ..results.history import Table, history_units
from ..results.loading import has_pressure, pressure_alone
from ..system.files import replaced
from ..units import MMHG
from . import body as deformed
from .body import OBLIQUE, Body, View

__all__ = ["GAMMA_MAP", "STYLE", "Frame", "comparison_picture", "density_bar", "density_picture", "draw_bodies",
           "draw_body", "ledger_picture", "loading_picture", "page", "panels", "save", "tip_picture"]

History = Mapping[str, np.ndarray]  # columns, as `output.History.load` gives them

#: Colours of gamma from 0 (nearly black) to 1 (intact, pale grey); the lightness rises throughout.
GAMMA_MAP = LinearSegmentedColormap.from_list("relative density", [
    (0.0, "#0b0724"), (0.2, "#51127c"), (0.4, "#a5317e"), (0.6, "#e8605d"), (0.8, "#fdb57f"), (0.93, "#e9dccf"),
    (1.0, "#d3dae1")])
#: Bands of the ledger from the bottom up: what is lost (warm), then what is still there (cool).
BANDS = {"sink_stored": ("$D$, from stored energy", "#a63d40"), "sink_kinetic": ("$D$, from motion", "#e08e79"),
         "deletion": ("left in deleted elements", "#7a6c5d"), "released": ("released in relaxing", "#f2cc8f"),
         "viscous": ("viscous", "#c6b38e"),
         "kinetic": ("kinetic", "#86bbd8"), "elastic": ("elastic", "#33658a"), "contact": ("contact", "#5b8e7d"),
         "numerical": ("numerical", "#9b9b9b")}
RED, BLUE, SAND = (BANDS[name][1] for name in ("sink_stored", "elastic", "released"))
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans", "svg.hashsalt": "skfsink", "font.size": 8, "axes.titlesize": 8, "axes.labelsize": 8,
    "axes.linewidth": 0.6, "figure.titlesize": 9, "legend.fontsize": 7, "legend.frameon": False,
    "xtick.labelsize": 7, "ytick.labelsize": 7, "xtick.major.width": 0.6,
    "ytick.major.width": 0.6, "lines.linewidth": 1.2}
WIDTH, TALLEST, DPI = 7.2, 9.0, 300  # size of a picture [in], dots per inch
GAMMA_SCALE = ScalarMappable(Normalize(0, 1), GAMMA_MAP)
SPEED_MAP = matplotlib.colormaps["viridis"]


def draw_body(ax: Axes, body: Body, title: str, scale: ScalarMappable = GAMMA_SCALE) -> None:
    """A body, its colours (gamma, unless another `scale` says what they are) shaded by its brightness."""
    points = body.triangles.reshape(-1, 5)
    colour: Any = scale.to_rgba(points[:, 4])
    colour[:, :3] *= points[:, 3:4]
    if len(points):  # something is left of the body
        corners = np.arange(len(points)).reshape(-1, 3)
        mesh = TriMesh(Triangulation(points[:, 0], points[:, 1], corners), rasterized=True)
        mesh.set_facecolor(colour)
        ax.add_collection(mesh, autolim=False)
    ax.add_collection(LineCollection(list(body.outline), colors="0.35", linewidths=0.4), autolim=False)
    ax.set_title(title)


def panels(axes: Sequence[Axes], bodies: Sequence[Body], titles: Sequence[str], box: np.ndarray) -> None:
    """Bodies at one scale, with titles and a colour bar of gamma."""
    draw_bodies(axes, bodies, titles, box)
    density_bar(axes)


def draw_bodies(axes: Sequence[Axes], bodies: Sequence[Body], titles: Sequence[str], box: np.ndarray,
            scale: ScalarMappable = GAMMA_SCALE) -> None:
    for ax, body, title in zip(axes, bodies, titles):
        draw_body(ax, body, title, scale)
        ax.set(xlim=box[:, 0], ylim=box[:, 1], aspect="equal", xlabel="$x$ (mm)", ylabel="$y$ (mm)")
        ax.locator_params(nbins=5)
        if not len(body.outline):  # a body in space: the axes of the picture are not those of the body
            ax.set_axis_off()


def density_bar(axes: Sequence[Axes], **where: Any) -> None:
    """Colour bar of gamma beside the axes; `where` is passed on to matplotlib."""
    bar = axes[0].figure.colorbar(GAMMA_SCALE, ax=axes,
                                  **{"aspect": 25, "pad": 0.02, "shrink": 0.8, **where})
    bar.set_label(r"relative density $\gamma$")


# --- pictures of the density ---
@matplotlib.rc_context(STYLE)
def density_picture(space: Space, frames: Sequence[Frame], path: str | Path, title: str = "",
                    view: View = OBLIQUE) -> None:
    """Relative density on the deformed body, a panel for each frame; cracks (gamma < 0.1) stand open."""
    bodies, box, ratio = deformed.bodies(space, frames, view)
    figure, axes = page(len(frames), ratio)
    panels(axes, bodies, [frame.title for frame in frames], box)
    for ax in axes:
        ax.label_outer()
    save(figure, path, title)


def page(n: int, ratio: float) -> tuple[Figure, list[Axes]]:
    """A page with `n` panels of this height over width."""
    panel = {columns: min((WIDTH - 1.3) / columns - 0.1, ((TALLEST - 0.6) * columns / n - 0.3) / ratio)  # width [in]
             for columns in range(1, n + 1) if n % columns == 0}
    columns = max(c for c in panel if panel[c] > 0.6 * max(panel.values()))
    figure = Figure((WIDTH, n // columns * (panel[columns] * ratio + 0.3) + 0.6), layout="compressed")
    axes: list[Axes] = figure.subplots(n // columns, columns, squeeze=False).ravel().tolist()
    return figure, axes


@matplotlib.rc_context(STYLE)
def comparison_picture(space: Space, dynamic_frame: Frame, quasistatic_frame: Frame, dyn_history: History,
                       qs_history: History, path: str | Path, *, title: str = "", view: View = OBLIQUE) -> None:
    """The dynamic crack beside the quasi-static one, and below them where the energy of both is at the end."""
    bodies, box, ratio = deformed.bodies(space, (dynamic_frame, quasistatic_frame), view)
    tall = min(2.9 * ratio, 6.0)
    figure = Figure((WIDTH, tall + 2.9), layout="constrained")
    axes = figure.subplot_mosaic([["a", "b"], ["c", "c"]], height_ratios=[tall, 1.9])
    names = [f"(a) dynamic {dynamic_frame.title}", f"(b) quasi-static {quasistatic_frame.title}"]
    panels([axes["a"], axes["b"]], bodies, names, box)
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
    save(figure, path, title)


# --- curves ---
def _event(history: History) -> tuple[dict[str, np.ndarray], np.ndarray, str, str]:
    """Rows of the event; their times [µs], or steps where time stands still; the label of these; the unit of energy."""
    rows = np.flatnonzero(history["phase"] == "event")
    if not rows.size:
        raise ValueError("the history has no rows of the event")
    event = {name: values[rows] for name, values in history.items()}
    unit = history_units(_dimension(history))["elastic"]
    if np.ptp(event["time_s"]) > 0:
        return event, event["time_s"] * 1e6, "time since onset (µs)", unit
    return event, event["step"].astype(float), "pass", unit


def _dimension(history: History) -> int:
    """Dimensions of the body, on which units depend."""
    in_space = history.dim == 3 if isinstance(history, Table) else np.isfinite(history["tip_z_mm"]).any()
    return 3 if in_space else 2


@matplotlib.rc_context(STYLE)
def loading_picture(history: Table, path: str | Path, title: str = "", event: Table | None = None) -> None:
    """The loading, from the unloaded body on, over the least relative density: load over displacement, and of a body
    under pressure the pressure over the volume that its boundary has swept; both where grips move as well.

    `event` has the rows of the event that the loading has ended in: the onset is marked then, and the way of the load
    from there on is drawn as well.
    """
    rows = Table({name: values[history["phase"] == "loading"] for name, values in history.items()}, history.dim,
                 history.without)
    units = history_units(_dimension(history))
    curves = []
    if not pressure_alone(rows):
        curves.append(("grip_displacement_mm", "reaction_N_per_mm", 1.0, "displacement (mm)", "load",
                       units["reaction_N_per_mm"]))
    if has_pressure(rows):
        volume = units["swept_volume"].replace("^", "$^") + "$"
        what = "swept area" if _dimension(history) == 2 else "swept volume"
        curves.append(("swept_volume", "pressure_MPa", 1e3, f"{what} ({volume})", "pressure", "kPa"))
    figure = Figure((WIDTH if len(curves) > 1 else WIDTH / 2 + 0.6, 4.2), layout="constrained")
    axes = figure.subplots(2, len(curves), sharex="col", height_ratios=[3, 1], squeeze=False)
    for (across, up, factor, xlabel, ylabel, unit), (ax, low) in zip(curves, axes.T):
        x, y, gamma = rows[across], factor * rows[up], rows["gamma_min"]
        if event is not None:
            ax.plot(event[across], factor * event[up], color="0.55", linewidth=0.8, label="event")
        ax.plot(np.append(0, x), np.append(0, y), "k.-", markersize=3, label="loading")
        if event is not None and len(x):
            ax.plot(x[-1], y[-1], "o", color=RED, markersize=5, zorder=3,
                    label=f"onset: {y[-1]:.3g} {unit} at {x[-1]:.3g} {xlabel.partition('(')[2][:-1]}")
            ax.legend(*(entry[::-1] for entry in ax.get_legend_handles_labels()), loc="best")
        ax.set_ylabel(f"{ylabel} ({unit})")
        low.plot(np.append(0, x), np.append(1, gamma), color=RED)
        least = float(gamma.min()) if len(gamma) else 1.0
        low.set(xlabel=xlabel, ylabel=r"least $\gamma$", ylim=(min(0.95, 1.1 * least - 0.1), None))
        for limit, data in ((ax.set_xlim, ax.dataLim.intervalx), (ax.set_ylim, ax.dataLim.intervaly)):
            if data[0] >= 0.0:  # nothing moved back: the corner is the unloaded body
                limit(0, None)
        if unit == "kPa":
            beside = ax.secondary_yaxis("right", functions=(lambda p: p * MMHG / 1e3, lambda p: p * 1e3 / MMHG))
            beside.set_ylabel("mmHg")
    figure.align_ylabels()
    save(figure, path, title)


@matplotlib.rc_context(STYLE)
def ledger_picture(history: History, path: str | Path, title: str = "") -> None:
    """Where the energy is during the event, stacked so that the top edge is the total; below, what does not add up."""
    event, time, label, unit = _event(history)
    figure = Figure((WIDTH, 4.2), layout="constrained")
    ax, low = figure.subplots(2, 1, sharex=True, height_ratios=[4, 1], subplot_kw={"xmargin": 0})
    total = np.zeros(len(time))
    without = history.without if isinstance(history, Table) else frozenset()
    for name, (meaning, colour) in BANDS.items():
        if name not in without and (name in OPTIONAL_TERMS or np.any(event[name])):
            ax.fill_between(time, total, total + event[name], label=meaning, color=colour, linewidth=0)
            total = total + event[name]
    ax.plot(time, total, "k", label="total")
    if np.any(event["loads"]) or np.any(event["pressure_work"]):
        fed_in = total[0] + event["loads"][0] + event["work"] - event["loads"]
        ax.plot(time, fed_in, ":", color="#d9a441", label="start, work\nand loads")
    ax.plot(time, event["U_paper"], "k--", label="$U$ of the paper")
    ax.set(ylabel=f"energy ({unit})", ylim=(0, None))
    figure.legend(*(entry[::-1] for entry in ax.get_legend_handles_labels()), loc="outside right upper")
    error = 100 * event["balance"] / (event["elastic"][0] + event["kinetic"][0])
    limit = max(0.01, 1.2 * np.abs(error).max())
    low.plot(time, error, "k")
    low.set(xlabel=label, ylabel="balance error\n(% of onset)", ylim=(-limit, limit))
    figure.align_ylabels()
    save(figure, path, title)


@matplotlib.rc_context(STYLE)
def tip_picture(history: History, path: str | Path, title: str, shear_wave_speed: float,
                rayleigh_wave_speed: float) -> None:
    """Where the leading tip is, how fast beside the wave speeds [m/s] (if finite), and the number of branches."""
    event, time, label, _ = _event(history)
    figure = Figure((WIDTH / 2 + 0.6, 4.2), layout="constrained")
    timed = bool(np.isfinite(shear_wave_speed))
    ax, low = figure.subplots(2, 1, sharex=True, height_ratios=[1, 1] if timed else [3, 1], subplot_kw={"xmargin": 0})
    ax.plot(time, event["crack_length_mm"], "k", label="crack length")
    for name, line in (("x", "-"), ("y", "--"), ("z", ":")):
        if np.isfinite(event[f"tip_{name}_mm"]).any():
            ax.plot(time, event[f"tip_{name}_mm"], line, color=BLUE, label=f"tip, ${name}$")
    ax.set_ylabel("length, position (mm)")
    ax.legend()
    low.set_xlabel(label)
    count = low
    if timed:
        speed = event["tip_speed_m_per_s"]
        low.plot(time, speed, color=RED)
        low.axhline(shear_wave_speed, color="0.3", linewidth=0.8, label="$c_s$")
        low.axhline(rayleigh_wave_speed, color="0.3", linewidth=0.8, linestyle="--", label="$c_R$")
        low.set_ylim(0, 1.2 * np.nanmax([shear_wave_speed, *speed]))
        low.set_ylabel("tip speed (m/s)", color=RED)
        low.legend(loc="upper right", ncols=2)
        count = low.twinx()
    count.step(time, event["branches"], where="post", color=BLUE)
    most = max(2 if timed else 1, event["branches"].max())
    count.set(xmargin=0, ylim=(0, 3 * most if timed else most + 0.5))  # in the lower third, clear of the speed
    count.set_ylabel("branches", color=BLUE)
    count.locator_params(axis="y", nbins=6, integer=True)
    save(figure, path, title)


def save(figure: Figure, path: str | Path, title: str) -> None:
    """Write a figure with its title, in the format that the name of the file says.

    A title that is wider than the figure is broken at a comma, as near to its middle as can be.
    """
    figure.suptitle(title)
    if title and figure.get_suptitle():
        _fit(figure)
    kind = Path(path).suffix.lstrip(".") or "png"
    undated = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}
    with replaced(path) as part:
        figure.savefig(part, format=kind, dpi=DPI, metadata=undated.get(kind))


def _fit(figure: Figure) -> None:
    """Break a title that is too wide, and make it smaller if that does not do."""
    title: Any = figure._suptitle  # type: ignore[attr-defined]
    room, renderer = 0.98 * figure.bbox.width, FigureCanvasAgg(figure).get_renderer()

    def width() -> float:
        return float(title.get_window_extent(renderer).width)

    text = title.get_text()
    if width() > room and "\n" not in text and (commas := [i for i, letter in enumerate(text) if letter == ","]):
        at = min(commas, key=lambda i: abs(i - len(text) / 2))
        title.set_text(f"{text[:at + 1]}\n{text[at + 2:]}")
    if (wide := width()) > room:
        title.set_fontsize(title.get_fontsize() * room / wide)
