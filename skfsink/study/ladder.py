"""The ladder of models of each scene, measured: `python -m skfsink.study.ladder` writes `cases/<case>/ladder.json`.

Every level of :data:`.models.LADDERS` is run once, on one core; it goes on where it was stopped. A further run on
another mesh of the same sizes tells how much of an error may be that of the mesh.
"""

# ruff: noqa: E402

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..errors import ParameterError
from ..run.display import Display
from ..run.model import LADDERS, SCATTER, Ladder, ladder_path, level
from ..run.quantities import crack_cells, measured
from ..run.simulate import Simulation
from ..run.two_pass import corridor_report, lay_corridor
from ..scene.options import Options
from ..scene.registry import find_case
from ..scene.scene import Scene
from .ladder_chart import draw_ladders
from .store import Store

__all__ = ["MESHES", "ladder", "measure"]

#: mesh of each case on which its models are compared
MESHES = {"single_edge_notch": "M3", "simple_shear": "coarse", "symmetric_double_edge_notch": "coarse",
          "asymmetric_double_edge_notch": "M3", "dog_bone": "coarse", "cylindrical_shell": "coarse"}
FLAG = Parameter(negative="", show_default=False)


def ladder(*cases: str, fresh: Annotated[bool, FLAG] = False, draw: Annotated[bool, FLAG] = False,
           out: Path | None = None, quiet: Annotated[bool, FLAG] = False) -> None:
    """Measure the price and the error of each model of the cases, and draw one against the other.

    Parameters
    ----------
    cases
        Names of the cases; all six without any.
    fresh
        Measure all models anew; without it, those that are stored are kept.
    draw
        Only draw what is stored.
    out
        Folder for CASE/ladder.json and the picture; by default they go where the program and its docs read them.
    quiet
        Show no progress.
    """
    for case in cases:
        if case not in LADDERS:
            raise ParameterError(f"case must be one of {', '.join(LADDERS)}; got {case!r}")
    with Display(quiet) as display:
        for case in () if draw else cases or tuple(LADDERS):
            store = Store(_file(case, out), f"ladder of {case}", fresh)
            display.phase(case)
            names = (*LADDERS[case], SCATTER)
            _warm(case) if set(names) - store.points.keys() else None
            for i, name in enumerate(names):
                display.update(i / len(names), name)
                store.point(name, partial(measure, case, name))
    picture = (out or Path(__file__).resolve().parents[2] / "docs" / "images") / "ladder.png"
    picture.parent.mkdir(parents=True, exist_ok=True)
    draw_ladders({case: Ladder(case, path) for case in LADDERS if (path := _file(case, out)).exists()}, picture)


def _file(case: str, out: Path | None) -> Path:
    return ladder_path(case) if out is None else out / case / "ladder.json"


def scene_of(case: str, options: Options, mesh: str, **dimensions: Any) -> tuple[Scene, dict[str, Any]]:
    """The scene of a case and the arguments of its function."""
    found = find_case(case)
    arguments = {**found.default_arguments, "mesh": mesh, **dimensions}
    return found.scene(arguments, options), arguments


def measure(case: str, name: str, mesh: str = "", base: Options = Options()) -> dict[str, Any]:  # noqa: B008
    """Run a level without drawing: its figures for the whole sample, its crack, and its price in processor time [s].

    `mesh` is that of :data:`MESHES` by default; `base` holds the other options.
    """
    mesh = mesh or MESHES[case]
    seed = {"mesh_seed": 1} if name == SCATTER else {}
    options = level(case, "dynamics" if seed else name).apply(base)
    with tempfile.TemporaryDirectory() as temporary, Display(quiet=True) as display:
        folder, start, cpu = Path(temporary), time.perf_counter(), time.process_time()
        scene, arguments = scene_of(case, options, mesh, **seed)
        if options.mesh_layout == "two-pass":
            options = lay_corridor(scene, arguments, options, folder, display)
            scene, _ = scene_of(case, options, mesh)
        made = time.perf_counter() - start
        simulation = Simulation(scene, folder, display)
        state = simulation.run()
        price = time.process_time() - cpu
        event = {"corridor": corridor_report(simulation, folder)} if options.mesh_layout == "two-pass" else {}
    tracker, cost = simulation.crack.tracker, simulation.cost()
    wall = {"mesh": made, "loading": cost["wall"]["loading"], "event": cost["wall"]["event"]}
    space, steps = scene.sample.space, cost["steps"]
    return {"mesh": mesh, "made": bool(scene.sample.made), "elements": space.n_elements,
            "quantities": measured(scene, simulation), "crack": crack_cells(scene, state, tracker.arrival),
            "price_s": price, "wall": wall, "steps": steps, "factorisations": cost["factorisations"],
            "mean_step_s": state.time / steps if options.analysis == "dynamic" and steps else None,
            "branches": tracker.max_branches, "warnings": simulation.notes.texts, **event}


def _warm(case: str) -> None:
    """Have the loops of the case compiled, or read from the cache, before they are timed."""
    others: dict[str, list[dict[str, Any]]] = {"dog_bone": [{"element": "planestress"}], "cylindrical_shell": []}
    solid = case in others
    for values in ({}, *others.get(case, [{"dimensions": 3}])):
        with tempfile.TemporaryDirectory() as folder, Display(quiet=True) as display:
            scene, _ = scene_of(case if solid else "single_edge_notch", Options(event_time=1e-6, **values), "coarse")
            Simulation(scene, Path(folder), display).run()


if __name__ == "__main__":
    from ..cli.program import command

    command(ladder, package="study")
