"""Simple shear of a notched plate (Sec. 5.2): mode II, one crack that runs into the tensile half."""

from __future__ import annotations

from typing import Annotated, Any

from ..errors import choose
from ..loads.grips import Grip
from ..meshing.shapes import check_plate
from ..results.result import Result
from ..run.compute import run_case
from ..run.keywords import case_function
from ..scene.arrange import arrange
from ..scene.case import Case
from ..scene.options import SAMPLE, Options
from ..scene.scene import Scene
from ..units import Unit

__all__ = ["simple_shear"]

ASSUMED = (
    "side 5 mm: the paper prints no length of the plate; its 50,847 elements are then of size l/4.5 throughout",
    "notch 2.5 mm long, to the middle, at mid-height: not printed",
    "notch 0.1 mm = l wide with a round tip: not printed",
    "the top edge is free to move up and down: the paper prescribes its motion in x, and says of the bottom edge that "
    "both directions are fixed",
    "the mesh of the upper half is the mirror image of the lower one",
)


@case_function
def simple_shear(
        *,
        side: Annotated[float, SAMPLE, Unit("mm")] = 5.0,
        notch: Annotated[float, SAMPLE, Unit("mm")] = 2.5,
        notch_width: Annotated[float, SAMPLE, Unit("mm")] = 0.1,
        top: Annotated[str, SAMPLE] = "free",
        mesh: Annotated[str, SAMPLE] = "M4",
        mesh_seed: Annotated[int, SAMPLE] = 0,
        options: Options = Options(),  # noqa: B008
) -> Result:
    """Shear a square plate with a notch to its middle, slowly, and watch the crack.

    The bottom edge is fixed; the top edge moves to the right at `speed`. The plate is loaded statically to the onset
    of failure; the crack then runs dynamically or quasi-statically.

    Parameters
    ----------
    side
        Side of the plate [mm], > notch.
    notch
        Length of the notch up to its round tip, at mid-height [mm], in (notch-width/2, side).
    notch_width
        Width of the notch [mm], in (0, side).
    top
        "free" or "held": whether the top edge may move up and down, or keeps its height (two cracks then run).
    mesh
        "coarse" (element size l/4 where the crack runs), "M4" (l/4, wider), "paper" (l/4.5 throughout), or the path
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
    arguments = {"side": side, "notch": notch, "notch_width": notch_width, "top": top, "mesh": mesh,
           "mesh_seed": mesh_seed}
    return run_case(CASE, arguments, options)


def _scene(arguments: dict[str, Any], options: Options) -> Scene:
    check_plate(arguments["side"], arguments["notch"], arguments["notch_width"])
    height = None if choose("top", arguments["top"], ("free", "held")) == "free" else 0.0
    return Scene(
        case="simple_shear", title="Simple shear", parameters={**arguments, **options.parameters()},
        material=options.stored_energy(), sink_law=options.sink_law(), controls=options.controls(), assumed=ASSUMED,
        **arrange("simple_shear", arguments, options,
                  (Grip("top", (options.speed, height)), Grip("bottom", (0.0, 0.0))),
                  asymmetry="its halves are stretched and compressed"))


CASE = Case(simple_shear, _scene)

if __name__ == "__main__":
    from ..cli.program import command

    command(simple_shear)
