"""From the arguments of a case function to the files of a run."""

from __future__ import annotations

import logging
import os
import shlex
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import Interrupted
from ..fields.state import State
from ..meshing.kept_mesh import MESH, keep_mesh
from ..pictures.of_a_run import draw_comparison, draw_run
from ..results.history import History
from ..results.result import Result
from ..results.summary import write_summary
from ..scene.case import Case
from ..scene.options import Options
from ..scene.scene import Scene
from ..scene.stored import SCENE, corridor_mesh
from ..system.files import prepare_folder
from .checkpoint import load_checkpoint, load_state
from .checks import refuse
from .display import Display
from .memory import check_memory
from .occupied import occupied
from .request import RunRequest, read_request
from .simulate import Loaded, Simulation
from .summarize import summarize
from .two_pass import corridor_report, lay_corridor

__all__ = ["run_case"]

log = logging.getLogger(__name__)
SUMMARY = "summary.json"
PARTS = ("dynamic", "quasistatic")  # folders of the two runs of both analyses


def run_case(case: Case, arguments: dict[str, Any], options: Options) -> Result:
    """Run a case with the arguments of its function (all but `options`, with a `mesh` among them) and the options.

    With `options.resume` the arguments are those in that folder's `scene.toml`; any that was given besides must agree.

    Raises
    ------
    Interrupted
        Ctrl-C or SIGTERM; the message says how to go on.
    """
    request = read_request(case, arguments, options)
    try:
        with Display(options.quiet) as display:
            return _compute(request, display)
    except (Interrupted, KeyboardInterrupt):
        begun = (request.folder / SCENE).exists()
        raise Interrupted("interrupted; " + (f"go on with skfsink resume {shlex.quote(str(request.folder))}" if begun
                                             else "nothing was computed yet")) from None


def _compute(request: RunRequest, display: Display) -> Result:
    """Compute what was asked for, in a folder that no other run is in."""
    folder, both = request.folder, request.options.analysis == "both"
    if request.model_choice:
        display.say(request.model_choice["text"])
    scene = _checked_scene(request, display)
    folders = [folder, *(folder / part for part in PARTS if both)]
    before = [place for place in folders if place == folder or os.path.isdir(place)]
    with ExitStack() as locks:
        notes = [*request.notes, *_lock(locks, before)]
        if not request.resumes:
            _begin(folder, request.options.overwrite)
            if request.options.mesh_layout == "two-pass":
                corridor = lay_corridor(scene, request.arguments, request.options, folder, display)
                request = replace(request, options=corridor)
                scene = _checked_scene(request, display)
        notes += _lock(locks, [place for place in folders if place not in before])
        if both:
            return _run_both(scene, folder, display, request.resumes, notes)
        return _run_one(scene, folder, display, request.resumes, notes=notes)


def _checked_scene(request: RunRequest, display: Display) -> Scene:
    """The scene asked for, if it fits into the memory and, of a new run, is such as can be meant."""
    scene = request.scene()
    check_memory(scene, display)
    if not request.resumes:
        refuse(scene)  # before anything is written
    return scene


def _lock(locks: ExitStack, folders: Sequence[Path]) -> list[str]:
    """Keep other runs out of the folders until `locks` are left; warnings about those that cannot be locked."""
    return [locks.enter_context(occupied(folder)) for folder in folders]


def _begin(folder: Path, overwrite: bool) -> None:
    """Make the folder of a new run; what is left in it of an older one is no run that could be resumed."""
    prepare_folder(folder, overwrite)
    for name in (SCENE, SUMMARY, Simulation.CHECKPOINT, Simulation.ONSET):
        (folder / name).unlink(missing_ok=True)


def _write_scene(scene: Scene, folder: Path) -> None:
    """Write `scene.toml`, and before it the mesh unless it is one that comes with the program."""
    if scene.sample.source or scene.sample.made:
        keep_mesh(scene.sample, folder / MESH)
    scene.stored(MESH).write(folder)


def _run_both(scene: Scene, folder: Path, display: Display, resumes: bool, notes: Sequence[str]) -> Result:
    """The dynamic and the quasi-static run of a scene, of which the second begins at the onset of the first."""
    scenes = {analysis: scene.part(analysis) for analysis in PARTS}
    begun = {analysis: resumes and (folder / analysis / SCENE).exists() for analysis in PARTS}
    _check_parts({analysis: part for analysis, part in scenes.items() if begun[analysis]}, folder)
    if not resumes:
        for analysis in PARTS:
            _begin(folder / analysis, overwrite=True)
        _write_scene(scene, folder)
    parts: dict[str, Result] = {}
    onset: Loaded | None = None
    for analysis, part in scenes.items():
        if not begun[analysis]:
            _begin(folder / analysis, overwrite=True)
        parts[analysis] = _run_one(part, folder / analysis, display, begun[analysis], onset=onset, notes=notes)
        if parts[analysis].failed:
            onset = _onset(folder / "dynamic", scenes["dynamic"].fingerprint)
    return _combined(scene, folder, display, parts)


def _check_parts(scenes: Mapping[str, Scene], folder: Path) -> None:
    """Refuse to go on with parts that cannot, before any file is touched (CheckpointError)."""
    for analysis, scene in scenes.items():
        stored = load_checkpoint(folder / analysis / Simulation.CHECKPOINT, scene.fingerprint)
        if analysis == "dynamic" and stored.state.phase != "loading":
            load_state(folder / analysis / Simulation.ONSET, scene.fingerprint)


def _combined(scene: Scene, folder: Path, display: Display, parts: Mapping[str, Result]) -> Result:
    """Picture, summary and result of both analyses together."""
    display.phase("output")
    if all(part.failed for part in parts.values()):
        draw_comparison(parts["dynamic"], parts["quasistatic"], folder)
    first = parts["dynamic"]
    summary = {"schema": first.summary["schema"], "case": scene.case, "mesh": first.summary["mesh"], "analysis": "both",
               **{name: part.summary for name, part in parts.items()}}
    write_summary(folder / SUMMARY, summary)
    display.update(1.0, str(folder))
    return Result(folder, scene, summary, first.history, first.state, dict(parts))


def _onset(folder: Path, fingerprint: str) -> Loaded:
    memories = load_checkpoint(folder / Simulation.CHECKPOINT, fingerprint).memories
    return Loaded(load_state(folder / Simulation.ONSET, fingerprint), memories["observer Strength"])


def _run_one(scene: Scene, folder: Path, display: Display, resumes: bool, *, onset: Loaded | None = None,
             notes: Sequence[str] = ()) -> Result:
    """The run of a scene of one analysis, from `onset` on if there is one."""
    simulation = Simulation(scene, folder, display, resumes)
    with simulation.notes:
        for note in filter(None, notes):
            log.warning(note)
    if not resumes:
        simulation.checkpoint()  # from here on the run can be resumed, whenever it is killed
        _write_scene(scene, folder)
    _announce(simulation, folder, display)
    state = simulation.run(onset)
    return _finished(simulation, state, folder, display)


def _announce(simulation: Simulation, folder: Path, display: Display) -> None:
    """Say what is computed, and where."""
    scene = simulation.scene
    space = scene.sample.space
    for text in scene.sample.notes:
        display.say(f"note: {text}")
    display.say(f"{scene.title}, mesh {scene.sample.name}: {space.n_elements} elements, {int(simulation.free.sum())} + "
                f"{space.n_nodes} unknowns; {scene.controls.analysis} analysis in {folder}")


def _finished(simulation: Simulation, state: State, folder: Path, display: Display) -> Result:
    """Pictures, summary and result of a run that has come to its end."""
    scene = simulation.scene
    display.phase("output")
    display.update(0.0, "")
    draw_run(scene, folder, "loading" if simulation.unfailed else "run", simulation.frames.moments)
    simulation.costs.lap("output")
    corridor = {}
    if scene.parameters["mesh_layout"] == "two-pass":
        corridor["corridor"] = corridor_report(simulation, corridor_mesh(folder).parent)  # before the summary: it warns
    summary = {**summarize(scene, simulation), **corridor}
    write_summary(folder / SUMMARY, summary)
    display.update(1.0, str(folder))
    display.say(summary["verdict"])
    return Result(folder, scene, summary, History.load(folder / "history.csv"), state, {})
