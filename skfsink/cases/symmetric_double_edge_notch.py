"""Symmetric double-edge notched plate in tension (Sec. 5.3): two cracks that branch near each other, and merge."""

from __future__ import annotations

from typing import Annotated, Any

from ..loads.grips import Grip
from ..meshing.shapes import check_two_notches
from ..meshing.symmetry import Mirror
from ..results.result import Result
from ..run.compute import run_case
from ..run.keywords import case_function
from ..scene.arrange import arrange
from ..scene.case import Case
from ..scene.options import SAMPLE, Options
from ..scene.scene import Scene
from ..units import Unit

__all__ = ["symmetric_double_edge_notch"]

ASSUMED = (
    "side 3 mm: the paper prints no length; with notches of 0.45 mm, U is then near its 0.0295 N mm/mm",
    "notches 0.45 mm long at mid-height: not printed",
    "notches 0.1 mm = l wide with round tips: not printed",
    "the grips hold the plate sideways: not printed",
    "element size l/5 on the mesh `paper`: not printed",
    "the mesh of one half is that of the other turned by half a turn, so that both notches have the same elements",
)


@case_function
def symmetric_double_edge_notch(
        *,
        side: Annotated[float, SAMPLE, Unit("mm")] = 3.0,
        notch: Annotated[float, SAMPLE, Unit("mm")] = 0.45,
        notch_width: Annotated[float, SAMPLE, Unit("mm")] = 0.1,
        mesh: Annotated[str, SAMPLE] = "M4",
        mesh_seed: Annotated[int, SAMPLE] = 0,
        options: Options = Options(),  # noqa: B008
) -> Result:
    """Pull a square plate with equal notches from both sides apart, slowly, and watch the cracks.

    The grips at the top and bottom edge move apart at `speed` each and hold the plate sideways. The plate is loaded
    statically to the onset of failure; the cracks then run dynamically or quasi-statically.

    Parameters
    ----------
    side
        Side of the plate [mm], > 2 notch.
    notch
        Length of each notch up to its round tip, at mid-height [mm], in (notch-width/2, side/2).
    notch_width
        Width of the notches [mm], in (0, side).
    mesh
        "coarse", "mirror" (mirror-symmetric), "M4", "paper", "M8" (element size l/3, l/1.5, l/4, l/5, l/8), or the path
        of a mesh file.
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
    check_two_notches(arguments["side"], arguments["notch"], arguments["notch_width"])
    speed = options.speed
    return Scene(
        case="symmetric_double_edge_notch", title="Symmetric double-edge notched plate",
        parameters={**arguments, **options.parameters()}, material=options.stored_energy(), sink_law=options.sink_law(),
        controls=options.controls(), assumed=ASSUMED,
        **arrange("symmetric_double_edge_notch", arguments, options,
                  (Grip("top", (0.0, speed)), Grip("bottom", (0.0, -speed))),
                  mirrors=(Mirror(0, arguments["side"] / 2),)))


CASE = Case(symmetric_double_edge_notch, _scene)

if __name__ == "__main__":
    from ..cli.program import command

    command(symmetric_double_edge_notch)
