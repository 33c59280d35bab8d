"""From the arguments of a case function to the files of a run."""

from __future__ import annotations

import inspect
import logging
import os
import shlex
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from ..errors import Interrupted, OutputError, ParameterError
from ..meshing.kept_mesh import MESH, keep_mesh, mesh_name, origin
from ..meshing.outline import has_gmsh
from ..pictures.of_a_run import draw_comparison, draw_run
from ..results.history import History
from ..results.result import Result
from ..results.summary import write_summary
from ..scene.options import NOT_PHYSICS, Options
from ..scene.scene import Scene
from ..scene.stored import SCENE, corridor_mesh, kept, read_choice, read_parameters
from ..system.files import prepare_folder, write_atomic
from .checkpoint import load_checkpoint, load_state
from .checks import refuse
from .display import Display
from .memory import check_memory
from .model import AUTO, choose_model
from .occupied import occupied
from .simulate import Loaded, Simulation
from .summarize import summarize
from .two_pass import corridor_report, lay_corridor

__all__ = ["run_case"]

log = logging.getLogger(__name__)
SceneMaker = Callable[[dict[str, Any], Options], Scene]
SUMMARY = "summary.json"
PARTS = ("dynamic", "quasistatic")  # folders of the two runs of both analyses


def run_case(case: Callable[..., Result], make_scene: SceneMaker, own: dict[str, Any], options: Options) -> Result:
    """Run a case: `own` are the arguments of its function, `make_scene` turns them into a scene.

    With `options.resume` the arguments are those in that folder's `scene.toml`; any that was given besides must agree.

    Raises
    ------
    Interrupted
        Ctrl-C or SIGTERM; the message says how to go on.
    """
    name = case.__name__
    if Path(own["mesh"]).suffix:  # a file: the run may be resumed from another folder
        own = {**own, "mesh": str(Path(own["mesh"]).absolute())}
    defaults = {k: p.default for k, p in inspect.signature(case).parameters.items()}
    choice: dict[str, Any] = {}
    resume = options.resume is not None
    if resume:
        own, options, choice = _resumed(name, own, defaults, options)
    elif options.model:
        options, choice = choose_model(name, own, defaults, options)
    folder = options.resume or options.out or _default_folder(name, own, options)
    notes: list[str] = []
    if options.mesh_layout == "two-pass" and not has_gmsh():
        notes.append("there is no gmsh to make the mesh of two passes: the mesh of the layout corridor is taken")
        options = replace(options, mesh_layout="corridor")
    try:
        with Display(options.quiet) as display:
            if choice:
                display.say(choice["text"])
            scene = replace(make_scene(own, options), choice=choice)
            check_memory(scene, display)
            if not resume:
                refuse(scene)  # before anything is written
            with ExitStack() as locks:
                places = [folder, *(folder / part for part in PARTS if options.analysis == "both")]
                there = [place for place in places if place == folder or os.path.isdir(place)]
                notes += [locks.enter_context(occupied(place)) for place in there]
                if not resume:
                    _begin(folder, options.overwrite)
                    if options.mesh_layout == "two-pass":
                        options = lay_corridor(scene, own, options, folder, display)
                        scene = replace(make_scene(own, options), choice=choice)
                        check_memory(scene, display)
                        refuse(scene)
                notes += [locks.enter_context(occupied(place)) for place in places if place not in there]
                if options.analysis == "both":
                    return _run_both(scene, folder, display, resume, notes)
                return _run_one(scene, folder, display, resume, notes=notes)
    except (Interrupted, KeyboardInterrupt):
        begun = (folder / SCENE).exists()
        raise Interrupted("interrupted; " + (f"go on with skfsink resume {shlex.quote(str(folder))}" if begun else
                                             "nothing was computed yet")) from None


def _default_folder(case: str, own: dict[str, Any], options: Options) -> Path:
    mesh = mesh_name(own["mesh"])
    name = f"{mesh}-{options.analysis}"
    if options.model:
        return Path("results") / case / f"{mesh}-{options.model}"
    if options.analysis != "quasistatic" and options.integrator != "explicit":
        name += f"-{options.integrator}"
    return Path("results") / case / name


def _resumed(case: str, own: dict[str, Any], defaults: dict[str, Any],
             options: Options) -> tuple[dict[str, Any], Options, dict[str, Any]]:
    folder = options.resume
    assert folder is not None
    if options.out is not None and options.out.absolute() != folder.absolute():
        raise ParameterError(f"--out {options.out} and --resume {folder} are two folders; a run stays in its own")
    stored, choice = read_parameters(folder, case), read_choice(folder)
    if options.model not in ("", AUTO, choice.get("model")):
        raise ParameterError(f"--model {options.model} is not that of the run in {folder} ({choice.get('model')}); "
                             f"a resumed run keeps its scene")
    defaults = {**Options().parameters(), **defaults}
    for name, value in {**own, **options.parameters()}.items():
        same = value == stored.get(name) or (name == "mesh" and origin(value) == origin(str(stored.get(name))))
        if (name in options.given or value != defaults[name]) and not same:
            raise ParameterError(f"--{name.replace('_', '-')} {value} is not that of the run in {folder} "
                                 f"({stored.get(name)}); a resumed run keeps its scene")
    known = {f.name for f in fields(Options)} - set(NOT_PHYSICS)
    try:
        own = {k: stored.pop(k, defaults[k]) for k in own}
        if unknown := stored.keys() ^ known:
            raise KeyError(*sorted(unknown))
    except KeyError as error:
        raise OutputError(f"{folder / SCENE} is not the scene of a run: parameter {error}") from None
    return own, replace(options, **stored, corridor=corridor_mesh(folder), kept=kept(folder, own)), choice


def _begin(folder: Path, overwrite: bool) -> None:
    """Make the folder of a new run; what is left in it of an older one is no run that could be resumed."""
    prepare_folder(folder, overwrite)
    for name in (SCENE, SUMMARY, Simulation.CHECKPOINT, Simulation.ONSET):
        (folder / name).unlink(missing_ok=True)


def _write_scene(scene: Scene, folder: Path) -> None:
    """Write `scene.toml`, and before it the mesh unless it is one that comes with the program."""
    if scene.sample.source or scene.sample.made:
        keep_mesh(scene.sample, folder / MESH)
    write_atomic(folder / SCENE, scene.toml(MESH))


def _run_both(scene: Scene, folder: Path, display: Display, resume: bool,
              notes: Sequence[str]) -> Result:
    scenes = {analysis: scene.part(analysis) for analysis in PARTS}
    begun = {analysis: resume and (folder / analysis / SCENE).exists() for analysis in scenes}
    for analysis, part in scenes.items():  # refuse before any file is touched
        if begun[analysis]:
            stored = load_checkpoint(folder / analysis / Simulation.CHECKPOINT, part.fingerprint)
            if analysis == "dynamic" and stored.state.phase != "loading":
                load_state(folder / analysis / Simulation.ONSET, part.fingerprint)
    if not resume:
        for analysis in scenes:
            _begin(folder / analysis, overwrite=True)
        _write_scene(scene, folder)
    parts: dict[str, Result] = {}
    onset: Loaded | None = None
    for analysis, part in scenes.items():
        if not begun[analysis]:
            _begin(folder / analysis, overwrite=True)
        parts[analysis] = _run_one(part, folder / analysis, display, begun[analysis], onset, notes)
        if parts[analysis].failed:
            onset = _onset(folder / "dynamic", scenes["dynamic"].fingerprint)
    display.phase("output")
    if all(part.failed for part in parts.values()):
        draw_comparison(parts["dynamic"], parts["quasistatic"], folder)
    first = parts["dynamic"]
    summary = {"schema": first.summary["schema"], "case": scene.case, "mesh": first.summary["mesh"], "analysis": "both",
               **{name: part.summary for name, part in parts.items()}}
    write_summary(folder / SUMMARY, summary)
    display.update(1.0, str(folder))
    return Result(folder, scene, summary, first.history, first.state, parts)


def _onset(folder: Path, fingerprint: str) -> Loaded:
    memories = load_checkpoint(folder / Simulation.CHECKPOINT, fingerprint).memories
    return Loaded(load_state(folder / Simulation.ONSET, fingerprint), memories["observer Strength"])


def _run_one(scene: Scene, folder: Path, display: Display, resume: bool, onset: Loaded | None = None,
             notes: Sequence[str] = ()) -> Result:
    simulation = Simulation(scene, folder, display, resume)
    with simulation.notes:
        for note in filter(None, notes):
            log.warning(note)
    if not resume:
        simulation.checkpoint()  # from here on the run can be resumed, whenever it is killed
        _write_scene(scene, folder)
    space = scene.sample.space
    for text in scene.sample.notes:
        display.say(f"note: {text}")
    display.say(f"{scene.title}, mesh {scene.sample.name}: {space.n_elements} elements, {int(simulation.free.sum())} + "
                f"{space.n_nodes} unknowns; {scene.controls.analysis} analysis in {folder}")
    state = simulation.run(onset)
    display.phase("output")
    display.update(0.0, "")
    draw_run(scene, folder, "loading" if simulation.unfailed else "run", simulation.frames.moments)
    simulation.costs.lap("output")
    two = scene.parameters["mesh_layout"] == "two-pass"
    corridor = {"corridor": corridor_report(simulation, corridor_mesh(folder).parent)} if two else {}  # it may warn
    summary = {**summarize(scene, simulation), **corridor}
    write_summary(folder / SUMMARY, summary)
    display.update(1.0, str(folder))
    display.say(summary["verdict"])
    return Result(folder, scene, summary, History.load(folder / "history.csv"), state, {})
