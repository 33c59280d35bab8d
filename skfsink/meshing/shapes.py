"""The samples' shapes: outlines, where their elements are fine, and the sizes of the committed meshes.

Each sample has a function that returns its mesh; its keyword arguments are the sample's dimensions [mm], the element
sizes and the `seed`. `h_tip` is the size of the elements along the round tips of notches, around which elements are
laid in rings (see :mod:`.ring`); None is a sixth of its radius, and with 0 there are no rings.
Three-dimensional samples are meshed as a section, which :mod:`.sweeping` turns into hexahedra. The meshes in
`cases/<sample>/meshes` are from `python -m skfsink.meshing.shapes <sample> [--mesh M3]` and gmsh 4.15.2.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import meshio
import numpy as np

from ..errors import require
from .edge import ALONG
from .outline import Band, Box, Distance, Edge, SizeField, completed, mesh_outline, scaled_jacobian
from .vtu import write_mesh

__all__ = ["SHAPES", "Shape", "check_dog_bone", "check_plate", "check_shell",
           "check_two_notches"]

Point = tuple[float, float]
Image = Callable[[np.ndarray], np.ndarray]


def single_edge_notch_mesh(*, side: float = 4.0, notch: float = 1.0, notch_width: float = 0.1,
                           h: float = 0.1 / 3, h_coarse: float = 0.11, h_tip: float | None = None,
                           half_height: float = 1.68, symmetry: str = "none", distance: Distance | None = None,
                           seed: int = 0) -> meshio.Mesh:
    """Mesh the square plate [0, side]^2 with a round-tipped notch from the left edge at mid-height.

    `notch` is the length of the notch up to its tip, the top of a semicircle of diameter `notch_width`. The
    element size is `h` in the corridor ahead of the notch, up to `half_height` above and below it and out to
    the right edge, and is graded to `h_coarse` elsewhere; with `distance` (see :class:`.SizeField`) the corridor is
    where that is 0. Lengths are in mm. Each `seed` gives another mesh of the same sizes. With `symmetry` "mirror" the
    upper half is the mirror image of the lower one. The boundaries are `left` (without the mouth of the notch),
    `right`, `top`, `bottom` and `notch` (both flanks and the tip).
    """
    check_plate(side, notch, notch_width)
    require("half_height", half_height, "mm", low=0, low_open=True)
    middle = side / 2
    corridor = (notch - 1.5 * notch_width, side, middle - half_height, middle + half_height)
    size = SizeField(h, h_coarse, (corridor,), distance=distance)
    return _edge_notched(side, _Notch(notch, notch_width, h_tip), size=size, symmetry=symmetry, seed=seed)


def simple_shear_mesh(*, side: float = 5.0, notch: float = 2.5, notch_width: float = 0.1, h: float = 0.025,
                      h_coarse: float = 0.11, h_tip: float | None = None, half_width: float = 0.8,
                      symmetry: str = "mirror", distance: Distance | None = None, seed: int = 0) -> meshio.Mesh:
    """Mesh the square plate [0, side]^2 with a round-tipped notch from the left edge to the middle.

    Sheared to the right at its top, the plate cracks from the tip down to the right, to the right edge a quarter up.
    Elements are of size `h` around the tip and in a band of `half_width` on each side of that line, graded to
    `h_coarse` elsewhere. The upper half is the mirror image of the lower one, so that the stretched and the compressed
    side of the tip have the same elements, unless `symmetry` is "none". Boundaries as those of the single-edge notched
    plate.
    """
    check_plate(side, notch, notch_width)
    require("half_width", half_width, "mm", low=0, low_open=True)
    middle = side / 2
    tip: Box = (notch - 0.25, notch + 0.35, middle - 0.35, middle + 0.35)
    path: Band = (notch, middle, side, middle / 2, half_width)
    size = SizeField(h, h_coarse, (tip,), (path,), distance=distance)
    return _edge_notched(side, _Notch(notch, notch_width, h_tip), size=size, symmetry=symmetry, seed=seed)


def symmetric_double_edge_notch_mesh(*, side: float = 3.0, notch: float = 0.45, notch_width: float = 0.1,
                                     h: float = 0.025, h_coarse: float = 0.11, h_tip: float | None = None,
                                     half_height: float = 0.7, symmetry: str = "turn",
                                     distance: Distance | None = None, seed: int = 0) -> meshio.Mesh:
    """Mesh the square plate [0, side]^2 with equal notches from the left and the right edge at mid-height.

    Fine within `half_height` of mid-height between the notches. The right half is the left one turned by half a turn,
    or, with `symmetry` "mirror", its mirror image; with "none" it is a mesh of its own. The boundaries are `left`,
    `right`, `top`, `bottom` and `notch` (of both).
    """
    check_two_notches(side, notch, notch_width)
    require("half_height", half_height, "mm", low=0, low_open=True)
    middle = side / 2
    fine = (notch - 0.15, side - notch + 0.15, middle - half_height, middle + half_height)
    size = SizeField(h, h_coarse, (fine,), distance=distance)
    if symmetry == "mirror":
        def image(points: np.ndarray) -> np.ndarray:
            return points * (-1, 1) + (side, 0)

        half = mesh_outline(_left_half(side, _Notch(notch, notch_width, h_tip), middle), _even(size, image), seed=seed)
        return completed(half, "seam", image, {"left": "right"})
    return _double_edge_notched(side, _Notch(notch, notch_width, h_tip), 0.0, size=size, symmetry=symmetry, seed=seed)


def asymmetric_double_edge_notch_mesh(*, side: float = 5.0, notch: float = 0.5, notch_width: float = 0.1,
                                      offset: float = 1.25, h: float = 0.025, h_coarse: float = 0.11,
                                      h_tip: float | None = None, half_height: float = 1.25, symmetry: str = "turn",
                                      distance: Distance | None = None, seed: int = 0) -> meshio.Mesh:
    """Mesh the square plate [0, side]^2 with a notch from each side, the right one higher by `offset`.

    Both are `offset`/2 from mid-height. Fine within `half_height` of mid-height, where the notches and the cracks
    are. The right half is the left one turned by half a turn, unless `symmetry` is "none". The boundaries are
    `left`, `right`, `top`, `bottom` and `notch` (of both).
    """
    check_two_notches(side, notch, notch_width)
    require("offset", offset, "mm", low=0, high=side - 2 * notch_width, high_open=True)
    require("half_height", half_height, "mm", low=0, low_open=True)
    fine = (0.0, side, side / 2 - half_height, side / 2 + half_height)
    size = SizeField(h, h_coarse, (fine,), distance=distance)
    return _double_edge_notched(side, _Notch(notch, notch_width, h_tip), offset, size=size, symmetry=symmetry,
                                seed=seed)


def dog_bone_mesh(*, length: float = 10.0, gauge_length: float = 4.0, gauge_width: float = 1.5, grip_width: float = 3.0,
                  fillet: float = 0.75, h: float = 0.02, h_coarse: float = 0.11, distance: Distance | None = None,
                  seed: int = 0) -> meshio.Mesh:
    """Mesh the section of a dog-bone: centre at the origin, pulled along y.

    A gauge of `gauge_length` and `gauge_width` widens over quarter circles of radius `fillet`, tangent to it, to
    shoulders and ends of `grip_width`. Fine in the gauge and the fillets. The four quarters are mirror images of each
    other. The boundaries are `top`, `bottom` and `side`.
    """
    check_dog_bone(length, gauge_length, gauge_width, grip_width, fillet)
    end, gauge, neck, wide = length / 2, gauge_length / 2, gauge_width / 2, grip_width / 2
    shoulder, rim, arc = gauge + fillet, neck + fillet, fillet * (1 - math.sqrt(0.5))
    straight = [] if math.isclose(rim, wide) else [Edge("side", (wide, shoulder))]
    outline = [Edge("waist", (neck, 0)), Edge("side", (neck, gauge)),
               Edge("side", (rim, shoulder), via=(neck + arc, shoulder - arc)), *straight, Edge("side", (wide, end)),
               Edge("top", (0, end)), Edge("axis", (0, 0))]

    def across(points: np.ndarray) -> np.ndarray:
        return points * (-1, 1)

    def along(points: np.ndarray) -> np.ndarray:
        return points * (1, -1)

    size = SizeField(h, h_coarse, ((0, rim, 0, shoulder),), distance=distance)
    quarter = mesh_outline(outline, _even(_even(size, across), along), seed=seed)
    return completed(completed(quarter, "axis", across), "waist", along, {"top": "bottom"})


def cylindrical_shell_mesh(*, inner_radius: float = 1.9, thickness: float = 0.1, length: float = 5.0,
                           notch: float = 1.0, notch_width: float = 0.1, h: float = 0.025, h_coarse: float = 0.11,
                           h_tip: float | None = None, half_height: float = 1.2, distance: Distance | None = None,
                           seed: int = 0) -> meshio.Mesh:
    """Mesh the unrolled mid-surface of a half cylinder, [0, pi r] x [0, length], with a slit in its middle.

    r is the mean radius; x is the arc and y the axis of the cylinder. The slit is `notch` long from tip to tip, along
    the arc, with round ends of diameter `notch_width`. Fine within `half_height` of mid-length. The two halves along
    the arc are mirror images. The boundaries are `top`, `bottom`, `edge` (the straight free edges) and `notch`.
    """
    check_shell(inner_radius, thickness, length, notch, notch_width)
    arc, middle = math.pi * (inner_radius + thickness / 2), length / 2
    require("half_height", half_height, "mm", low=0, low_open=True)
    r, crown, tip = notch_width / 2, arc / 2, arc / 2 - notch / 2
    outline = [Edge("bottom", (crown, 0)), Edge("seam", (crown, middle - r)), Edge("notch", (tip + r, middle - r)),
               Edge("notch", (tip + r, middle + r), via=(tip, middle), h=_Notch(notch, notch_width, h_tip).h),
               Edge("notch", (crown, middle + r)), Edge("seam", (crown, length)), Edge("top", (0, length)),
               Edge("edge", (0, 0))]
    corridor = (0.0, arc, middle - half_height, middle + half_height)

    def image(points: np.ndarray) -> np.ndarray:
        return points * (-1, 1) + (arc, 0)

    half = mesh_outline(outline, _even(SizeField(h, h_coarse, (corridor,), distance=distance), image), seed=seed)
    return completed(half, "seam", image)


# --- outlines ---
def check_plate(side: float, notch: float, notch_width: float) -> None:
    """Refuse dimensions [mm] that are no plate with a notch from its edge (ParameterError)."""
    require("side", side, "mm", low=0, low_open=True)
    require("notch_width", notch_width, "mm", low=0, high=side, low_open=True, high_open=True)
    require("notch", notch, "mm", low=notch_width / 2, high=side, low_open=True, high_open=True)


def check_dog_bone(length: float, gauge_length: float, gauge_width: float, grip_width: float, fillet: float) -> None:
    """Refuse dimensions [mm] that are no dog-bone (ParameterError)."""
    for name, value in (("gauge-length", gauge_length), ("gauge-width", gauge_width), ("fillet", fillet)):
        require(name, value, "mm", low=0, low_open=True)
    require("length", length, "mm", low=gauge_length + 2 * fillet, low_open=True)
    require("grip_width", grip_width, "mm", low=gauge_width + 2 * fillet)


def check_shell(inner_radius: float, thickness: float, length: float, notch: float, notch_width: float) -> None:
    """Refuse dimensions [mm] that are no half cylinder with a slit (ParameterError)."""
    require("inner_radius", inner_radius, "mm", low=0, low_open=True)
    require("thickness", thickness, "mm", low=0, high=2 * inner_radius, low_open=True, high_open=True)
    require("length", length, "mm", low=0, low_open=True)
    require("notch_width", notch_width, "mm", low=0, high=length, low_open=True, high_open=True)
    arc = math.pi * (inner_radius + thickness / 2)
    require("notch", notch, "mm", low=notch_width, high=arc, low_open=True, high_open=True)


class _Notch(NamedTuple):
    """Length up to the tip and width of a notch, and the size asked for along its tip [mm]; see `h`."""

    length: float
    width: float
    h_tip: float | None

    @property
    def h(self) -> float | None:
        """Size of the elements in the innermost ring around the tip [mm], None for no rings."""
        return self.width / 2 / ALONG if self.h_tip is None else self.h_tip or None

    def from_left(self, y: float) -> list[Edge]:
        """From the left edge above the notch, at height `y`, to the left edge below it."""
        r, tip = self.width / 2, self.length
        return [Edge("left", (0, y + r)), Edge("notch", (tip - r, y + r)),
                Edge("notch", (tip - r, y - r), via=(tip, y), h=self.h), Edge("notch", (0, y - r))]


def check_two_notches(side: float, notch: float, notch_width: float) -> None:
    """Refuse dimensions [mm] that are no plate with a notch from each side (ParameterError)."""
    check_plate(side, notch, notch_width)
    require("notch", notch, "mm", low=notch_width / 2, high=side / 2, low_open=True, high_open=True)


def _left_half(side: float, notch: _Notch, y: float) -> list[Edge]:
    """Left half of a square plate with a notch from the left edge at height `y`."""
    return [Edge("bottom", (side / 2, 0)), Edge("seam", (side / 2, side)), Edge("top", (0, side)),
            *notch.from_left(y), Edge("left", (0, 0))]


def _even(size: SizeField, image: Image) -> SizeField:
    """The size field with the symmetry `image` of a mesh: a corridor is laid along the image of a path as well."""
    distance = size.distance
    if distance is None:
        return size

    def nearer(x: float, y: float) -> float:
        return min(distance(x, y), distance(*image(np.array([[x, y]]))[0].tolist()))

    return replace(size, distance=nearer)


def _edge_notched(side: float, notch: _Notch, *, size: SizeField, symmetry: str, seed: int) -> meshio.Mesh:
    """Square plate with a notch from the left edge at mid-height; with `symmetry` "mirror" of equal halves."""
    middle, r, tip = side / 2, notch.width / 2, notch.length
    if symmetry == "mirror":
        def image(points: np.ndarray) -> np.ndarray:
            return points * (1, -1) + (0, side)

        s = r * math.sqrt(0.5)
        lower = [Edge("bottom", (side, 0)), Edge("right", (side, middle)), Edge("seam", (tip, middle)),
                 Edge("notch", (tip - r, middle - r), via=(tip - r + s, middle - s), h=notch.h),
                 Edge("notch", (0, middle - r)), Edge("left", (0, 0))]
        return completed(mesh_outline(lower, _even(size, image), seed=seed), "seam", image, {"bottom": "top"})
    outline = [Edge("bottom", (side, 0)), Edge("right", (side, side)), Edge("top", (0, side)),
               *notch.from_left(middle), Edge("left", (0, 0))]
    return mesh_outline(outline, size, seed=seed)


def _double_edge_notched(side: float, notch: _Notch, offset: float, *, size: SizeField, symmetry: str,
                         seed: int) -> meshio.Mesh:
    """Square plate with notches from the left and the right edge, the right one higher by `offset`."""
    left, right = (side - offset) / 2, (side + offset) / 2

    def turned(points: np.ndarray) -> np.ndarray:
        return side - points

    if symmetry == "turn":
        half = mesh_outline(_left_half(side, notch, left), _even(size, turned), seed=seed, image=turned)
        return completed(half, "seam", turned, {"left": "right", "top": "bottom", "bottom": "top"})
    r, tip = notch.width / 2, side - notch.length
    return mesh_outline(
        [Edge("bottom", (side, 0)), Edge("right", (side, right - r)), Edge("notch", (tip + r, right - r)),
         Edge("notch", (tip + r, right + r), via=(tip, right), h=notch.h), Edge("notch", (side, right + r)),
         Edge("right", (side, side)), Edge("top", (0, side)), *notch.from_left(left), Edge("left", (0, 0))],
        size, seed=seed)


# --- the committed meshes ---
class Shape(NamedTuple):
    """How a sample is meshed, and the settings of its named meshes."""

    make: Callable[..., meshio.Mesh]
    meshes: Mapping[str, Mapping[str, Any]]


# Sizes are l/1.5, l/3, l/4 and l/5 for the length l = 0.1 mm, moved by at most 1 %. The extent of the fine elements and
# the sizes away from the cracks are chosen so that the numbers of elements are within 3 % of the paper's: 11,140,
# 18,967 and 28,784 in Table 1, 50,847 in Sec. 5.2 and 28,531 in Sec. 5.4 (both l/4.5), 82,382 hexahedra in Sec. 5.5
# and 53,122 in Sec. 5.6, in two layers each.
SHAPES: dict[str, Shape] = {
    "single_edge_notch": Shape(single_edge_notch_mesh, {
        "coarse": {"h": 0.1 / 1.5}, "M3": {"h": 0.0331}, "M4": {"h": 0.02505}, "M5": {"h": 0.0202},
        "coarse-mirror": {"h": 0.064, "symmetry": "mirror"}, "M3-mirror": {"h": 0.0331, "symmetry": "mirror"}}),
    "simple_shear": Shape(simple_shear_mesh, {
        "coarse": {"h": 0.025, "half_width": 0.4}, "M4": {"h": 0.025},
        "paper": {"h": 0.0222, "half_width": 5.0}}),
    "symmetric_double_edge_notch": Shape(symmetric_double_edge_notch_mesh, {
        "coarse": {"h": 0.1 / 3}, "mirror": {"h": 0.064, "symmetry": "mirror"}, "M4": {"h": 0.025},
        "paper": {"h": 0.02}, "M8": {"h": 0.0125}}),
    "asymmetric_double_edge_notch": Shape(asymmetric_double_edge_notch_mesh, {
        "coarse": {"h": 0.05}, "M3": {"h": 0.1 / 3}, "M4": {"h": 0.025}, "paper": {"h": 0.0222}}),
    "dog_bone": Shape(dog_bone_mesh, {
        "coarse": {"h": 0.1 / 1.5}, "paper": {"h": 0.02, "h_coarse": 0.0265}}),
    "cylindrical_shell": Shape(cylindrical_shell_mesh, {
        "coarse": {"h": 0.1 / 1.5}, "paper": {"h": 0.025, "half_height": 1.18}}),
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the meshes of a sample and write them below `cases`."""
    parser = argparse.ArgumentParser(prog="python -m skfsink.meshing.shapes", description=main.__doc__)
    parser.add_argument("sample", choices=SHAPES)
    parser.add_argument("--mesh", default="all", help="name of a mesh, or all of them (default)")
    parser.add_argument("--output", type=Path, help="folder (default: cases/<sample>/meshes of the checkout)")
    options = parser.parse_args(arguments)
    make, settings = SHAPES[options.sample]
    if options.mesh != "all" and options.mesh not in settings:
        parser.error(f"--mesh must be one of {', '.join(settings)} or all")
    folder = options.output or Path(__file__).resolve().parents[2] / "cases" / options.sample / "meshes"
    folder.mkdir(parents=True, exist_ok=True)
    for name in settings if options.mesh == "all" else [options.mesh]:
        mesh = make(**settings[name])
        write_mesh(folder / f"{name}.vtu", mesh)
        quality = scaled_jacobian(mesh.points, mesh.cells_dict["quad"])
        print(f"{name}: {len(quality)} elements, {len(mesh.points)} nodes, "
              f"scaled Jacobian >= {quality.min():.3f}, 1 % quantile {np.quantile(quality, 0.01):.3f}")


if __name__ == "__main__":
    main()
