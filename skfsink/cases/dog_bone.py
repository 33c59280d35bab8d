"""Dog-bone in tension, in three dimensions (Sec. 5.5): straight cracks from the ends of the gauge, no branches.

With `--element planestress` its section is computed in two dimensions as a thin sheet: a small part of the cost.
"""

from __future__ import annotations

from typing import Annotated, Any

from ..errors import require
from ..loads.grips import Grip
from ..meshing.shapes import check_dog_bone
from ..meshing.sweeping import swept
from ..meshing.symmetry import Mirror
from ..results.result import Result
from ..run.compute import run_case
from ..run.keywords import case_function
from ..scene.arrange import arrange
from ..scene.case import Case
from ..scene.options import SAMPLE, Options
from ..scene.scene import Scene
from ..units import Unit

__all__ = ["dog_bone"]

ASSUMED = (
    "length 10 mm: the paper prints the thickness only",
    "gauge 4 mm long and 1.5 mm wide, ends 3 mm wide, fillets of 0.75 mm tangent to the gauge: not printed",
    "element size l/5 in gauge and fillets, l/3.8 in the ends, two layers: chosen to meet 82,382 elements",
    "the four quarters of the mesh are mirror images of each other",
)


@case_function
def dog_bone(
        *,
        length: Annotated[float, SAMPLE, Unit("mm")] = 10.0,
        gauge_length: Annotated[float, SAMPLE, Unit("mm")] = 4.0,
        gauge_width: Annotated[float, SAMPLE, Unit("mm")] = 1.5,
        grip_width: Annotated[float, SAMPLE, Unit("mm")] = 3.0,
        fillet: Annotated[float, SAMPLE, Unit("mm")] = 0.75,
        thickness: Annotated[float, SAMPLE, Unit("mm")] = 0.2,
        layers: Annotated[int, SAMPLE] = 2,
        mesh: Annotated[str, SAMPLE] = "coarse",
        mesh_seed: Annotated[int, SAMPLE] = 0,
        options: Options = Options(),  # noqa: B008
) -> Result:
    """Pull a dog-bone apart, slowly, and watch the cracks.

    The ends move apart at `speed` each along y and hold the sample in x and z. It is loaded statically to the onset of
    failure; the cracks then run dynamically or quasi-statically. With the element "planestress" the section alone is
    computed, as a sheet that thins freely, in N and N mm per mm of thickness.

    Parameters
    ----------
    length
        Length along y [mm], > gauge-length + 2 fillet.
    gauge_length
        Length of the part of constant width [mm], > 0.
    gauge_width
        Its width along x [mm], > 0.
    grip_width
        Width of the ends [mm], >= gauge-width + 2 fillet.
    fillet
        Radius of the quarter circles between the gauge and the ends, tangent to the gauge [mm], > 0.
    thickness
        Thickness along z [mm], > 0; in plane stress it only scales the `quantities` of the summary.
    layers
        Elements over the thickness, >= 1; none in plane stress.
    mesh
        "coarse", "paper" (element size l/1.5, l/5 in the gauge), or the path of a mesh file of hexahedra
        (plane stress: of quadrilaterals).
    mesh_seed
        Another mesh of the same sizes for each number; other than 0 it needs gmsh (the mesh extra).
    options
        Material, analysis and controls; see :class:`~skfsink.scene.options.Options`.

    Returns
    -------
    Result
        Summary, history and last state; its files are in the output folder.
    """
    arguments = {"length": length, "gauge_length": gauge_length, "gauge_width": gauge_width, "grip_width": grip_width,
           "fillet": fillet, "thickness": thickness, "layers": layers, "mesh": mesh, "mesh_seed": mesh_seed}
    return run_case(CASE, arguments, options)


def _scene(arguments: dict[str, Any], options: Options) -> Scene:
    check_dog_bone(*(arguments[name] for name in ("length", "gauge_length", "gauge_width", "grip_width", "fillet")))
    thickness = require("thickness", arguments["thickness"], "mm", low=0, low_open=True)
    layers = int(require("layers", arguments["layers"], low=1, high=100, whole=True))
    speed, plane = options.speed, options.element == "planestress"
    along, back = ((0.0, v) if plane else (0.0, v, 0.0) for v in (speed, -speed))
    return Scene(
        case="dog_bone", title="Dog-bone", parameters={**arguments, **options.parameters()},
        material=options.stored_energy(), sink_law=options.sink_law(), controls=options.controls(), assumed=ASSUMED,
        view=(-90.0, 70.0),
        **arrange("dog_bone", arguments, options, (Grip("top", along), Grip("bottom", back)),
                  lift=None if plane else lambda section: swept(section, thickness, layers),
                  faces=() if plane else ("back", "front"), mirrors=(Mirror(0, 0.0), Mirror(1, 0.0)),
                  thickness=thickness if plane else 1.0))


CASE = Case(dog_bone, _scene)

if __name__ == "__main__":
    from ..cli.program import command

    command(dog_bone)
