"""Half of a thin-walled cylinder in tension (Sec. 5.6): cracks along the circumference that branch, then waves."""

from __future__ import annotations

import math
from typing import Annotated, Any

from ..errors import require
from ..loads.grips import Grip
from ..meshing.shapes import check_shell
from ..meshing.sweeping import rolled, swept, unrolled
from ..meshing.symmetry import Mirror
from ..results.result import Result
from ..run.compute import run_case
from ..run.keywords import case_function
from ..scene.arrange import arrange
from ..scene.case import Case
from ..scene.options import SAMPLE, Options
from ..scene.scene import Scene
from ..units import Unit

__all__ = ["cylindrical_shell"]

ASSUMED = (
    "length 5 mm: the paper prints the inner radius and the thickness only",
    "slit 1 mm long along the circumference, at the crown and at mid-length, 0.1 mm = l wide with round ends: "
    "not printed",
    "element size l/4 within 1.18 mm of mid-length, two layers: chosen to meet 53,122 elements",
    "the two halves of the mesh are mirror images of each other",
)


@case_function
def cylindrical_shell(
        *,
        inner_radius: Annotated[float, SAMPLE, Unit("mm")] = 1.9,
        thickness: Annotated[float, SAMPLE, Unit("mm")] = 0.1,
        length: Annotated[float, SAMPLE, Unit("mm")] = 5.0,
        notch: Annotated[float, SAMPLE, Unit("mm")] = 1.0,
        notch_width: Annotated[float, SAMPLE, Unit("mm")] = 0.1,
        layers: Annotated[int, SAMPLE] = 2,
        mesh: Annotated[str, SAMPLE] = "coarse",
        mesh_seed: Annotated[int, SAMPLE] = 0,
        options: Options = Options(),  # noqa: B008
) -> Result:
    """Pull a half cylinder with a slit along its circumference apart, slowly, and watch the cracks.

    The two ends move apart at `speed` each along z and are held in x and y; the straight edges are free. The shell is
    loaded statically to the onset of failure; the cracks then run dynamically or quasi-statically.

    Parameters
    ----------
    inner_radius
        Inner radius [mm], > 0.
    thickness
        Thickness of the wall [mm], in (0, 2 inner-radius).
    length
        Length along the axis [mm], > notch-width.
    notch
        Length of the slit from tip to tip, along the mean circumference [mm], in (notch-width, the half circle).
    notch_width
        Width of the slit along the axis [mm], in (0, length).
    layers
        Elements over the thickness, >= 1.
    mesh
        "coarse", "paper" (element size l/1.5, l/4 around mid-length), or the path of a mesh file of hexahedra.
    mesh_seed
        Another mesh of the same sizes for each number; other than 0 it needs gmsh (the mesh extra).
    options
        Material, analysis and controls; see :class:`~skfsink.scene.options.Options`.

    Returns
    -------
    Result
        Summary, history and last state; its files are in the output folder.
    """
    arguments = {"inner_radius": inner_radius, "thickness": thickness, "length": length, "notch": notch,
           "notch_width": notch_width, "layers": layers, "mesh": mesh, "mesh_seed": mesh_seed}
    return run_case(CASE, arguments, options)


def _scene(arguments: dict[str, Any], options: Options) -> Scene:
    radius, thickness = arguments["inner_radius"], arguments["thickness"]
    check_shell(radius, thickness, arguments["length"], arguments["notch"], arguments["notch_width"])
    require("layers", arguments["layers"], low=1, high=100, whole=True)
    speed = options.speed
    return Scene(
        case="cylindrical_shell", title="Cylindrical shell", parameters={**arguments, **options.parameters()},
        material=options.stored_energy(), sink_law=options.sink_law(), controls=options.controls(), assumed=ASSUMED,
        view=(80.0, 25.0), flat=unrolled(radius, thickness),
        **arrange("cylindrical_shell", arguments, options,
                  (Grip("top", (0.0, 0.0, speed)), Grip("bottom", (0.0, 0.0, -speed))), faces=("back", "front"),
                  lift=lambda section: swept(section, thickness, arguments["layers"], rolled(radius, thickness)),
                  mirrors=(Mirror(0, math.pi / 2 * (radius + thickness / 2)),)))


CASE = Case(cylindrical_shell, _scene)

if __name__ == "__main__":
    from ..cli.program import command

    command(cylindrical_shell)
