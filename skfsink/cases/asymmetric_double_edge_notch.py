"""Asymmetric double-edge notched plate in tension (Sec. 5.4): two cracks that branch, arrest, and bridge."""

from __future__ import annotations

from typing import Annotated, Any

from ..errors import require
from ..loads.grips import Grip
from ..meshing.shapes import check_two_notches
from ..results.result import Result
from ..run.compute import run_case
from ..run.keywords import case_function
from ..scene.arrange import arrange
from ..scene.case import Case
from ..scene.options import SAMPLE, Options
from ..scene.scene import Scene
from ..units import Unit

__all__ = ["asymmetric_double_edge_notch"]

ASSUMED = (
    "side 5 mm: the paper prints no length; 28,531 elements of size l/4.5 in the fine part fit it",
    "notches 0.5 mm long: not printed; the cracks then branch and bridge as the paper describes",
    "offset 1.25 mm between the heights of the notches, half of it on each side of mid-height: not printed",
    "the mesh of one half is that of the other turned by half a turn, so that both notches have the same elements",
    "notches 0.1 mm = l wide with round tips: not printed",
)


@case_function
def asymmetric_double_edge_notch(
        *,
        side: Annotated[float, SAMPLE, Unit("mm")] = 5.0,
        notch: Annotated[float, SAMPLE, Unit("mm")] = 0.5,
        notch_width: Annotated[float, SAMPLE, Unit("mm")] = 0.1,
        offset: Annotated[float, SAMPLE, Unit("mm")] = 1.25,
        mesh: Annotated[str, SAMPLE] = "M3",
        mesh_seed: Annotated[int, SAMPLE] = 0,
        options: Options = Options(),  # noqa: B008
) -> Result:
    """Pull a square plate with a low notch on its left and a high one on its right apart, and watch the cracks.

    The grips at the top and bottom edge move apart at `speed` each and hold the plate sideways. The plate is loaded
    statically to the onset of failure; the cracks then run dynamically or quasi-statically.

    Parameters
    ----------
    side
        Side of the plate [mm], > 2 notch.
    notch
        Length of each notch up to its round tip [mm], in (notch-width/2, side/2).
    notch_width
        Width of the notches [mm], in (0, side).
    offset
        Height of the right notch above the left one [mm], in [0, side - 2 notch-width).
    mesh
        "coarse", "M3", "M4", "paper" (element size l/2, l/3, l/4, l/4.5), or the path of a mesh file.
    mesh_seed
        Another mesh of the same sizes for each number; other than 0 it needs gmsh (the mesh extra).
    options
        Material, analysis and controls; see :class:`~skfsink.scene.options.Options`.

    Returns
    -------
    Result
        Summary, history and last state; its files are in the output folder.
    """
    arguments = {"side": side, "notch": notch, "notch_width": notch_width, "offset": offset, "mesh": mesh,
           "mesh_seed": mesh_seed}
    return run_case(CASE, arguments, options)


def _scene(arguments: dict[str, Any], options: Options) -> Scene:
    side, notch, width = arguments["side"], arguments["notch"], arguments["notch_width"]
    check_two_notches(side, notch, width)
    require("offset", arguments["offset"], "mm", low=0, high=side - 2 * width, high_open=True)
    speed = options.speed
    return Scene(
        case="asymmetric_double_edge_notch", title="Asymmetric double-edge notched plate",
        parameters={**arguments, **options.parameters()}, material=options.stored_energy(), sink_law=options.sink_law(),
        controls=options.controls(), assumed=ASSUMED,
        **arrange("asymmetric_double_edge_notch", arguments, options,
                  (Grip("top", (0.0, speed)), Grip("bottom", (0.0, -speed))),
                  asymmetry="it is symmetric by half a turn, which no boundary can hold"))


CASE = Case(asymmetric_double_edge_notch, _scene)

if __name__ == "__main__":
    from ..cli.program import command

    command(asymmetric_double_edge_notch)
