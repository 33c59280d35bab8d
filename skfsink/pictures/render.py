"""Bodies in space as they are seen: the deformed surface, cut open along the crack, with light and shade.

It needs pyvista (the extra `view`), which draws without a display. What it gives is a picture as an array, at a known
scale; axes, scale bars, colour bars and letters are matplotlib's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.colors import Colormap

from ..errors import MissingExtra
from ..fem.space import Space
from ..fields.crack import CRACKED
from ..results.frame import SPENT, Frame
from ..results.series import VTK_ORDER
from . import body as deformed
from .plot import GAMMA_MAP, SPEED_MAP

__all__ = ["Camera", "bounds", "render", "surface"]

LEAST_PIECE = 1e-3      # of the faces; smaller fragments are left out
FINER = 3               # pixels rendered for one of the picture, along each side
_LIGHTS = ((-0.4, 0.7, 1.0, 0.30), (0.5, -0.6, 0.9, 0.16))  # right, up, to the observer, strength
_AMBIENT = 0.64


@dataclass(frozen=True)
class Camera:
    """A parallel projection.

    Parameters
    ----------
    towards: direction from the body to the observer.   up: direction that is up in the picture, as nearly as can be.
    """

    towards: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)

    @cached_property
    def axes(self) -> np.ndarray:
        """Unit vectors to the right, up, and to the observer, (3, 3)."""
        back = np.array(self.towards) / np.linalg.norm(self.towards)
        right = np.cross(self.up, back)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(back, right), back])

    def project(self, points: np.ndarray) -> np.ndarray:
        """Places of points (..., 3) in the picture, right and up [mm], (..., 2)."""
        return np.asarray(points @ self.axes[:2].T)


def bounds(space: Space, frames: Sequence[Frame], camera: Camera, margin: float = 0.02) -> np.ndarray:
    """Least and greatest place in the picture of the bodies [mm], fragments left out, with a margin, (2, 2)."""
    boxes = []
    for frame in frames:
        elements, x = deformed.live_elements(space, frame)
        boxes.append(deformed.extent(space, elements, camera.project(x), frame.gamma[space.conn[elements]]))
    box = np.array([np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)])
    return box + margin * np.ptp(box, axis=0).max() * np.array([[-1.0], [1.0]])


def surface(space: Space, frame: Frame, values: np.ndarray | None = None) -> Any:
    """The surface of what is left of the body, as a pyvista `PolyData` on the deformed shape.

    It ends where gamma falls below 0.1, and is closed there by the lips of the crack. Its point data are `gamma` and,
    if the frame has velocities, `speed` [mm/s]; with nodal `values` (n,) also `value`. It is cut in the undeformed
    body, where a spent node carries neither displacement nor velocity: the lips move with the nodes that are not spent.

    Raises
    ------
    MissingExtra
        pyvista is not installed.
    """
    pv = _pyvista()
    elements, _ = deformed.live_elements(space, frame)
    held = (frame.gamma >= SPENT).astype(float)
    grid = pv.UnstructuredGrid({pv.CellType.HEXAHEDRON: space.conn[elements][:, VTK_ORDER[3]]}, space.X)
    grid.point_data.update({"gamma": frame.gamma, "held": held, "u": held[:, None] * frame.u})
    if frame.v is not None:
        grid.point_data["v"] = held[:, None] * frame.v
    if values is not None:
        grid.point_data["value"] = held * values
    gamma = frame.gamma[space.conn[elements]]
    rim = np.flatnonzero((gamma.min(axis=1) < CRACKED) & (gamma.max(axis=1) >= CRACKED))
    skin = grid.extract_surface(algorithm="dataset_surface").clip_scalar(scalars="gamma", value=CRACKED, invert=False)
    parts = [skin.triangulate()]
    if rim.size:
        lips = grid.extract_cells(rim).contour([CRACKED], scalars="gamma", compute_normals=False)
        if lips.n_points:
            parts.append(lips.triangulate())
    whole = parts[0] if len(parts) == 1 else pv.merge(parts, merge_points=True)
    whole = whole.extract_surface(algorithm="dataset_surface").clean(tolerance=1e-9, absolute=True)
    weight = np.maximum(np.asarray(whole["held"]), 1e-6)[:, None]
    whole.points = np.asarray(whole.points) + np.asarray(whole["u"]) / weight
    if frame.v is not None:
        whole["speed"] = np.linalg.norm(np.asarray(whole["v"]) / weight, axis=1)
    if values is not None:
        whole["value"] = np.asarray(whole["value"]) / weight[:, 0]
    return _without_fragments(whole)


def _without_fragments(body: Any) -> Any:
    pieces = body.connectivity("all")
    piece = np.asarray(pieces.cell_data["RegionId"])
    small = np.bincount(piece) < LEAST_PIECE * len(piece)
    return pieces.extract_cells(~small[piece]).extract_surface(algorithm="dataset_surface") if small.any() else pieces


def render(space: Space, frame: Frame, camera: Camera, box: np.ndarray, width: int, *,
           field: str = "gamma", largest: float = 1.0, least: float = 0.0, values: np.ndarray | None = None,
           colours: Colormap | None = None) -> np.ndarray:
    """The body in colours of a field.

    Parameters
    ----------
    box: what the picture shows, places as of `Camera.project` [mm], (2, 2).
    width: of the picture in pixels; its height follows from `box`.
    field: "gamma", or "speed" in a frame with velocities; "value" of the nodal `values` (n,).
    largest, least: values of the last and the first colour, [mm/s] for the speed.
    colours: other ones than those of gamma and of the speed.

    Returns
    -------
    Picture (height, width, 3) of bytes on white.

    Raises
    ------
    MissingExtra
        pyvista is not installed.
    """
    pv = _pyvista()
    size = box[1] - box[0]
    height = max(1, round(width * float(size[1] / size[0])))
    with pv.vtk_verbosity("off"):  # which tells that there is no display
        picture = _shot(pv, surface(space, frame, values), camera, box, (FINER * width, FINER * height), field=field,
                        limits=(least, largest), colours=colours or (GAMMA_MAP if field == "gamma" else SPEED_MAP))
    coarse = np.asarray(picture, float).reshape(height, FINER, width, FINER, -1).mean(axis=(1, 3))
    return np.rint(coarse[..., :3]).astype(np.uint8)


def _shot(pv: Any, body: Any, camera: Camera, box: np.ndarray, pixels: tuple[int, int], *,
          field: str, limits: tuple[float, float], colours: Colormap) -> np.ndarray:
    right, up, back = camera.axes
    centre, far = box.mean(axis=0) @ camera.axes[:2], 100.0 * float(np.ptp(box, axis=0).max())
    plotter = pv.Plotter(off_screen=True, window_size=pixels, lighting="none")
    try:
        plotter.set_background("white")
        plotter.add_mesh(body, scalars=field, cmap=colours, clim=limits, n_colors=256, show_scalar_bar=False,
                         smooth_shading=True, split_sharp_edges=True, feature_angle=40.0, ambient=_AMBIENT,
                         diffuse=1.0, specular=0.0)
        for x, y, z, strength in _LIGHTS:
            light = pv.Light(position=centre + far * (x * right + y * up + z * back), focal_point=centre,
                             intensity=strength, light_type="scene light")
            light.positional = False
            plotter.add_light(light)
        plotter.camera.focal_point, plotter.camera.position = centre, centre + far * back
        plotter.camera.up = up
        plotter.camera.parallel_projection, plotter.camera.parallel_scale = True, float(box[1, 1] - box[0, 1]) / 2
        plotter.camera.clipping_range = (0.5 * far, 1.5 * far)
        return np.asarray(plotter.screenshot(return_img=True))
    finally:
        plotter.close()


def _pyvista() -> Any:
    try:
        import pyvista
    except ImportError:
        raise MissingExtra('pictures of bodies in space need pyvista: pip install "skfsink[view]"') from None
    return pyvista
