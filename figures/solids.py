"""The bodies in space: their cameras, pictures with a scale bar and axes, and sketches with dimensions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from layout import DPI
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator
from sketch import INK, RED, dimension, plane_sample

from skfsink.pictures.plot import GAMMA_MAP, SPEED_MAP
from skfsink.pictures.render import Camera, bounds, render
from skfsink.results.frame import Frame
from skfsink.results.reference import Reference
from skfsink.scene.scene import Scene

__all__ = ["DOG_BONE", "SHELL", "density_strip", "dog_bone", "gauge_box", "scale_bar", "shell",
           "speed_strip", "triad", "view"]

DOG_BONE = Camera((0.45, 0.12, 1.0))
SHELL = Camera((-0.75, 1.0, -0.4))


def view(ax: Axes, ref: Reference, frame: Frame, camera: Camera, box: np.ndarray, width: float, field: str = "gamma",
         largest: float = 1.0) -> None:
    """The body in an axes that is `width` inches wide, at the scale of `box` [mm]; `largest` [m/s] for the speed."""
    scale = 1e3 if field == "speed" else 1.0
    picture = render(ref.space, frame, camera, box, round(width * DPI), field=field, largest=largest * scale)
    ax.imshow(picture, extent=(box[0, 0], box[1, 0], box[0, 1], box[1, 1]))
    ax.set(xlim=box[:, 0], ylim=box[:, 1], aspect="equal")
    ax.set_axis_off()


def scale_bar(ax: Axes, box: np.ndarray, length: float = 1.0, corner: tuple[float, float] = (0.98, 0.03)) -> None:
    """A bar of `length` mm with its right end at that place, as shares of the box."""
    x, y = box[0] + np.array(corner) * (box[1] - box[0])
    ax.plot([x - length, x], [y, y], color="k", linewidth=1.5, solid_capstyle="butt", clip_on=False)
    ax.annotate(f"{length:g} mm", (x - length / 2, y), (0, 2), textcoords="offset points", ha="center", va="bottom",
                fontsize=7, annotation_clip=False)


def triad(ax: Axes, camera: Camera, box: np.ndarray, corner: tuple[float, float] = (0.1, 0.1),
          length: float = 0.7) -> None:
    """The axes of the body, `length` mm long, from that place."""
    origin = box[0] + np.array(corner) * (box[1] - box[0])
    for name, tip in zip("xyz", camera.project(length * np.eye(3)), strict=True):
        if np.hypot(*tip) < 0.12 * length:
            continue
        ax.annotate("", origin + tip, origin, arrowprops={
            "arrowstyle": "-|>,head_width=0.12,head_length=0.3", "linewidth": 0.7, "shrinkA": 0, "shrinkB": 0,
            "color": INK})
        ax.annotate(f"${name}$", origin + tip, tuple(5 * tip / np.hypot(*tip)), textcoords="offset points", ha="center",
                    va="center", fontsize=7)


def density_strip(cax: Axes) -> None:
    """Horizontal colour bar of gamma."""
    bar = cax.figure.colorbar(ScalarMappable(cmap=GAMMA_MAP), cax=cax, orientation="horizontal")
    bar.set_label(r"relative density $\gamma$")


def speed_strip(cax: Axes, largest: float) -> None:
    """Horizontal colour bar of the speed up to `largest` [m/s]."""
    bar = cax.figure.colorbar(ScalarMappable(Normalize(0, largest), SPEED_MAP), cax=cax, orientation="horizontal",
                              extend="max")
    bar.set_label("speed of the material (m/s)")
    bar.locator = MaxNLocator(4, steps=[1, 2, 5, 10])
    bar.update_ticks()


# --- dog-bone ---
def gauge_box(frames: Sequence[tuple[Reference, Frame]]) -> np.ndarray:
    """What shows the gauge and the fillets of dog-bones in all these frames [mm], (2, 2)."""
    own = frames[0][0].scene.parameters
    boxes = np.array([bounds(ref.space, [frame], DOG_BONE) for ref, frame in frames])
    box = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    end = own["gauge_length"] / 2 + own["fillet"] + 0.5
    for ref, frame in frames:
        X = ref.space.X
        for side in (-1, 1):
            rim = np.abs(X[:, 1] - side * end) < 0.2
            y = DOG_BONE.project((X + frame.u)[rim])[:, 1].mean()
            box[(side + 1) // 2, 1] = y if ref is frames[0][0] and frame is frames[0][1] else (
                min if side < 0 else max)(box[(side + 1) // 2, 1], y)
    return box


def dog_bone(ax: Axes, scene: Scene) -> None:
    """Sketch of the dog-bone: its dimensions in mm."""
    own, size = scene.parameters, plane_sample(ax, scene)
    length, gauge, wide, neck = (own[k] for k in ("length", "gauge_length", "grip_width", "gauge_width"))
    dimension(ax, (wide / 2, -length / 2), (wide / 2, length / 2), f"{length:g}", (0.13 * size, 0))
    dimension(ax, (neck / 2, -gauge / 2), (neck / 2, gauge / 2), f"{gauge:g}", (0.03 * size, 0))
    dimension(ax, (-neck / 2, 0), (neck / 2, 0), f"{neck:g}")
    dimension(ax, (-wide / 2, length / 2 - 0.08 * size), (wide / 2, length / 2 - 0.08 * size), f"{wide:g}")
    fillet, angle = own["fillet"], np.radians(225)
    centre = np.array([-neck / 2 - fillet, gauge / 2])
    at = centre + fillet * np.array([np.cos(angle + np.pi), np.sin(angle + np.pi)])
    ax.annotate(f"$R$ {fillet:g}", at, centre + np.array([0.1, -0.55]), arrowprops={
        "arrowstyle": "-|>,head_width=0.1,head_length=0.25", "linewidth": 0.5, "color": INK, "shrinkA": 0,
        "shrinkB": 0}, ha="center", va="top", fontsize=7)
    ax.annotate(f"thickness {own['thickness']:g}", (0, -length / 2 + 0.08 * size), ha="center", va="bottom", fontsize=7)
    ax.set(xlim=(-0.27 * size, 0.36 * size), ylim=(-0.68 * size, 0.68 * size), anchor="N")


# --- shell ---
def shell(ax: Axes, ref: Reference, width: float) -> None:
    """Sketch of the half cylinder: the body before it is loaded, with its dimensions in mm."""
    space, own = ref.space, ref.scene.parameters
    intact = Frame(np.nan, "", np.zeros_like(space.X), np.ones(space.n_nodes), np.zeros(space.n_elements, bool))
    box = bounds(space, [intact], SHELL)
    grown = np.ptp(box, axis=0) * [[-0.2, -0.16], [0.2, 0.16]] + box
    view(ax, ref, intact, SHELL, grown, width)
    ax.set_anchor("N")
    radius, thickness, length, notch = (own[k] for k in ("inner_radius", "thickness", "length", "notch"))
    outer, middle = radius + thickness, length / 2

    def at(angle: float, z: float, r: float = outer) -> tuple[float, float]:
        x, y = SHELL.project(np.array([r * np.cos(angle), r * np.sin(angle), z])).tolist()
        return x, y

    dimension(ax, at(np.pi, 0), at(np.pi, length), f"{length:g}", SHELL.project(np.array([-0.35, -0.25, 0.0])).tolist())
    centre = (0.0, 0.0)  # of the near end
    ax.annotate("", at(np.radians(50), 0, radius), centre, arrowprops={
        "arrowstyle": "-|>,head_width=0.12,head_length=0.3", "linewidth": 0.6, "color": INK, "shrinkA": 0,
        "shrinkB": 0})
    ax.plot(*centre, "+", color=INK, markersize=4, markeredgewidth=0.6)
    ax.annotate(f"$r_i$ {radius:g}, thickness {thickness:g}", centre, (0, -4), textcoords="offset points", ha="center",
                va="top", fontsize=7)
    half = notch / (2 * radius + thickness)
    ax.annotate(f"notch {notch:g}", at(np.pi / 2 + half, middle), at(np.pi * 0.72, 0.52 * length), fontsize=7,
                ha="center", va="top", arrowprops={"arrowstyle": "-", "linewidth": 0.5, "color": INK, "shrinkA": 0,
                                                   "shrinkB": 0})
    for z, sign in ((0.0, -1.0), (length, 1.0)):
        for angle in np.radians([15, 52, 90, 128, 165]):
            foot = at(angle, z, radius + thickness / 2)
            ax.annotate("", at(angle, z + sign * 0.55, radius + thickness / 2), foot, arrowprops={
                "arrowstyle": "-|>,head_width=0.12,head_length=0.3", "linewidth": 0.8, "color": RED, "shrinkA": 0,
                "shrinkB": 0})
        ax.annotate(r"$\bar v$", at(np.radians(90 if sign < 0 else 128), z + sign * 0.7), color=RED,
                    ha="right" if sign < 0 else "center", va="bottom", fontsize=7)
    ax.annotate("ends: $u_x=u_y=0$", (1, 1), xycoords="axes fraction", color=RED, ha="right", va="top", fontsize=7)
