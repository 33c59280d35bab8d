"""Single-edge notched plate in tension (Sec. 5.1): mode I, the crack branches dynamically and not quasi-statically."""

from __future__ import annotations

from typing import Annotated, Any

from ..loads.grips import Grip
from ..meshing.shapes import check_plate
from ..meshing.symmetry import Mirror
from ..results.result import Result
from ..run.compute import run_case
from ..run.keywords import case_function
from ..scene.arrange import arrange
from ..scene.case import Case
from ..scene.options import SAMPLE, Options
from ..scene.scene import Scene
from ..units import Unit

__all__ = ["single_edge_notch"]

ASSUMED = (
    "side 4 mm: the paper prints no length of the plate; N h^2 of Table 1 fits 10 to 11 mm^2 of fine mesh",
    "notch 1 mm long at mid-height: not printed; U is then near that of Table 1, with branches",
    "notch 0.1 mm = l wide with a round tip: not printed",
    "fine elements within 1.68 mm of mid-height, 0.11 mm elsewhere: chosen to meet the element counts of Table 1",
)


@case_function
def single_edge_notch(
        *,
        side: Annotated[float, SAMPLE, Unit("mm")] = 4.0,
        notch: Annotated[float, SAMPLE, Unit("mm")] = 1.0,
        notch_width: Annotated[float, SAMPLE, Unit("mm")] = 0.1,
        mesh: Annotated[str, SAMPLE] = "M3",
        mesh_seed: Annotated[int, SAMPLE] = 0,
        options: Options = Options(),  # noqa: B008
) -> Result:
    """Pull a square plate with an edge notch apart, slowly, and watch the crack.

    The grips at the top and bottom edge move apart at `speed` each and hold the plate sideways. The plate is loaded
    statically to the onset of failure; the crack then crosses it dynamically or quasi-statically.

    Parameters
    ----------
    side
        Side of the plate [mm], > notch.
    notch
        Length of the notch up to its round tip, at mid-height [mm], in (notch-width/2, side).
    notch_width
        Width of the notch [mm], in (0, side).
    mesh
        "coarse", "M3", "M4", "M5" (element size l/1.5, l/3, l/4, l/5), "coarse-mirror", "M3-mirror" (of equal halves),
        or the path of a mesh file.
    mesh_seed
        Another mesh of the same sizes for each number; other than 0 it needs gmsh (the mesh extra).
    options
        Material, analysis and controls; see :class:`~skfsink.scene.options.Options`.

    Returns
    -------
    Result
        Summary, history and last state; its files are in the output folder.
    """
    arguments = {"side": side, "notch": notch, "notch_width": notch_width, "mesh": mesh, "mesh_seed": mesh_seed}
    return run_case(CASE, arguments, options)


def _scene(arguments: dict[str, Any], options: Options) -> Scene:
    check_plate(arguments["side"], arguments["notch"], arguments["notch_width"])
    speed = options.speed
    return Scene(
        case="single_edge_notch", title="Single-edge notched plate", parameters={**arguments, **options.parameters()},
        material=options.stored_energy(), sink_law=options.sink_law(), controls=options.controls(), assumed=ASSUMED,
        **arrange("single_edge_notch", arguments, options, (Grip("top", (0.0, speed)), Grip("bottom", (0.0, -speed))),
                  mirrors=(Mirror(1, arguments["side"] / 2, along=True),)))


CASE = Case(single_edge_notch, _scene)

if __name__ == "__main__":
    from ..cli.program import command

    command(single_edge_notch)
