"""From a scene, or the arguments of a case function, to the files of a run."""

from __future__ import annotations

import logging
import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from ..errors import CheckpointError, Interrupted, ParameterError, SkfsinkError, first_line
from ..fem.linear import AUTO
from ..fields.state import State
from ..meshing.kept_mesh import MESH, keep_mesh
from ..methods.ranks.integrator import RankOptions, ranks_text
from ..methods.ranks.integrator import refuse as refuse_on_ranks
from ..pictures.of_a_run import draw_comparison, draw_run, draw_what_there_is
from ..results.history import History
from ..results.probes import PROBES
from ..results.result import Result
from ..results.status import STATUS
from ..results.stored_series import pack_series
from ..results.summary import write_summary
from ..results.vtkhdf import check_h5py
from ..scene.case import Case
from ..scene.deck import Deck
from ..scene.described import made_in_python
from ..scene.options import Options
from ..scene.registry import CASES, find_case
from ..scene.scene import Scene
from ..scene.schedule import check_observers
from ..scene.stored import SCENE, corridor_mesh
from ..system.files import path_of, prepare_folder
from .checkpoint import load_checkpoint, load_state
from .checks import refuse
from .display import Display
from .memory import check_memory, linear_of
from .observers.observer import Observer, Observers
from .observers.onset import Strength
from .observers.probe_surfaces import probes_of
from .occupied import occupied
from .request import RunRequest, read_request
from .simulate import Loaded, Simulation, standard_observers
from .summarize import summarize
from .told import told
from .two_pass import corridor_report, lay_corridor

__all__ = ["run", "run_case", "run_scene"]

log = logging.getLogger(__name__)
SUMMARY = "summary.json"
PARTS = ("dynamic", "quasistatic")  # folders of the two runs of both analyses


def run(scene: Scene, folder: str | Path, observers: Sequence[Observer] = (), *, resume: bool = False,
        overwrite: bool = False, quiet: bool = False) -> Result:
    """Run a scene in a folder.

    Parameters
    ----------
    scene: what to compute: made from its parts, by :meth:`.Deck.scene`, or read by :func:`.read_scene`.
    folder: where its files go.
    observers: look at the run beside those of every run, or in their place; see :class:`.Observer`. Of two analyses
        each gets copies of them, which are the `observers` of its part of the result.
    resume: go on with the run of this scene in `folder`, which must have had the same observers.
    overwrite: use a folder that is not empty.
    quiet: show no progress.

    Raises
    ------
    SkfsinkError
        What is wrong with the scene, the folder or the run, in one line.
    Interrupted
        Ctrl-C or SIGTERM; the same call with `resume` goes on.
    """
    if not isinstance(scene, Scene):
        is_deck = isinstance(scene, Deck | str | os.PathLike)
        raise ParameterError(f"run takes a Scene; got {scene!r:.80}"
                             + (": a deck is run by read_deck(...).run()" if is_deck else ""))
    path = path_of("folder", folder)
    with Display(quiet) as display:
        users = check_observers(observers)
        parts = made_in_python(scene, find_case(scene.case)) if scene.case in CASES else ()  # no other case reads one
        return _compute(scene, _Job(path, display, resume, users, made_in_python=parts), overwrite)


run_scene = run  # its name in `skfsink`, where `run` is the package


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
            if request.model_choice:
                display.say(request.model_choice["text"])
            job = _Job(request.folder, display, request.resumes, options.observers, request.notes,
                       made_in_python=request.made_in_python,
                       ranks=RankOptions(options.partition, options.frame_pieces))
            return _compute(request.scene(), job, request.options.overwrite, partial(_with_corridor, request))
    except (Interrupted, KeyboardInterrupt):
        begun = (request.folder / SCENE).exists()
        raise Interrupted(f"interrupted; {_how_to_go_on(request) if begun else 'nothing was computed yet'}") from None


def _how_to_go_on(request: RunRequest) -> str:
    folder = str(request.folder)
    python = [*(["the same observers"] if request.options.observers else []),
              *(f"the same {part}" for part in request.made_in_python)]
    if python:  # the command line has none
        return f"go on from Python with resume={folder!r} and {' and '.join(python)}"
    return f"go on with skfsink resume {shlex.quote(folder)}"


@dataclass(frozen=True)
class _Job:
    """Where a run goes, whether it goes on, who looks at it, and what it has to warn of at its beginning.

    `made_in_python` are the parts of its scene that are not as the case makes them; a case function leaves none but
    `stop`, where that is a function.
    """

    folder: Path
    display: Display
    resumes: bool
    observers: tuple[Observer, ...] = ()
    notes: tuple[str, ...] = ()
    made_in_python: tuple[str, ...] = ()
    ranks: RankOptions = field(default_factory=RankOptions)

    def part(self, analysis: str, resumes: bool) -> _Job:
        """That of one of both analyses, with observers of its own."""
        return replace(self, folder=self.folder / analysis, resumes=resumes, observers=_copied(self.observers))


def _copied(observers: Sequence[Observer]) -> tuple[Observer, ...]:
    """Copies of observers, which share what these share (ParameterError)."""
    copies: list[Observer] = []
    shared: dict[int, Any] = {}
    for observer in observers:
        try:
            copies.append(deepcopy(observer, shared))
        except Exception as error:  # whatever an attribute raises
            raise ParameterError(f"the observer {observer.name} cannot be copied ({first_line(error)}), and each run "
                                 f"of analysis both gets a copy: open files and the like in its `prepare`") from None
    return tuple(copies)


def _compute(scene: Scene, job: _Job, overwrite: bool,
             with_mesh: Callable[[Scene, Display], Scene] = lambda scene, _: scene) -> Result:
    """Compute a scene in a folder that no other run is in; `with_mesh` gives it a mesh that is made in this."""
    folder, both = job.folder, scene.controls.analysis == "both"
    _check(scene, job)
    folders = [folder, *(folder / part for part in PARTS if both)]
    before = [place for place in folders if place == folder or os.path.isdir(place)]
    with ExitStack() as locks:
        notes = [*job.notes, *_lock(locks, before)]
        if not job.resumes:
            _begin(folder, overwrite)
            remeshed = with_mesh(scene, job.display)
            if remeshed is not scene:
                _check(scene := remeshed, job)
        notes += _lock(locks, [place for place in folders if place not in before])
        job = replace(job, notes=tuple(filter(None, notes)))
        return _run_both(scene, job) if both else _run_one(scene, job)


def _check(scene: Scene, job: _Job) -> None:
    """Refuse what cannot be run, before anything is written: a folder that has no run to go on with, observers, a scene
    that does not fit into the memory or, of a new run, cannot be meant.
    """
    both = scene.controls.analysis == "both"
    if job.resumes and not (job.folder / SCENE).is_file():
        raise CheckpointError(f"there is no run to go on with in {job.folder}: it has no {SCENE}")
    users = (*probes_of(scene), *job.observers)
    for observer in Observers(standard_observers(scene, job.display), users, job.resumes and not both):
        observer.check(scene)
    if both:
        _copied(job.observers)
    check_memory(scene, job.display)
    c = scene.controls
    refuse_on_ranks(scene, c.analysis, c.integrator, linear_of(scene), job.ranks.partition, c.explicit.subcycled)
    if c.series == "vtkhdf":
        check_h5py()
        if job.ranks.frame_pieces:
            raise ParameterError("series vtkhdf has all frames in one file, and frame_pieces several a frame: take one")
    if not job.resumes:
        refuse(scene)


def _with_corridor(request: RunRequest, scene: Scene, display: Display) -> Scene:
    """The scene on the mesh of two passes, if that was asked for."""
    if request.options.mesh_layout != "two-pass":
        return scene
    options = lay_corridor(scene, request.arguments, request.options, request.folder, display)
    return replace(request, options=options).scene()


def _lock(locks: ExitStack, folders: Sequence[Path]) -> list[str]:
    """Keep other runs out of the folders until `locks` are left; warnings about those that cannot be locked."""
    return [locks.enter_context(occupied(folder)) for folder in folders]


def _begin(folder: Path, overwrite: bool) -> None:
    """Make the folder of a new run; what is left in it of an older one is no run that could be resumed."""
    prepare_folder(folder, overwrite)
    for name in (SCENE, SUMMARY, STATUS, Simulation.CHECKPOINT, Simulation.ONSET):
        (folder / name).unlink(missing_ok=True)
    for path in (folder / PROBES).glob("*.csv"):  # that are not written anew
        path.unlink()


def _write_scene(scene: Scene, folder: Path, parts: tuple[str, ...]) -> None:
    """Write `scene.toml`, and before it the mesh unless it is one that comes with the program.

    `parts` of the scene were made in Python.
    """
    if scene.sample.source or scene.sample.made:
        keep_mesh(scene.sample, folder / MESH)
    replace(scene.stored(MESH), made_in_python=parts).write(folder)


def _run_both(scene: Scene, job: _Job) -> Result:
    """The dynamic and the quasi-static run of a scene, of which the second begins at the onset of the first."""
    scenes, folder = {analysis: scene.part(analysis) for analysis in PARTS}, job.folder
    jobs = {analysis: job.part(analysis, job.resumes and (folder / analysis / SCENE).exists()) for analysis in PARTS}
    _check_parts({analysis: part for analysis, part in scenes.items() if jobs[analysis].resumes}, folder)
    if not job.resumes:
        for analysis in PARTS:
            _begin(folder / analysis, overwrite=True)
        _write_scene(scene, folder, job.made_in_python)
    parts: dict[str, Result] = {}
    onset: Loaded | None = None
    for analysis, part in scenes.items():
        if not jobs[analysis].resumes:
            _begin(folder / analysis, overwrite=True)
        parts[analysis] = _run_one(part, jobs[analysis], onset)
        if parts[analysis].failed:
            onset = _onset(folder / "dynamic", scenes["dynamic"].fingerprint, job.observers)
    return _combined(scene, job, parts)


def _check_parts(scenes: Mapping[str, Scene], folder: Path) -> None:
    """Refuse to go on with parts that cannot, before any file is touched (CheckpointError)."""
    for analysis, scene in scenes.items():
        stored = load_checkpoint(folder / analysis / Simulation.CHECKPOINT, scene.fingerprint)
        if analysis == "dynamic" and stored.state.phase != "loading":
            load_state(folder / analysis / Simulation.ONSET, scene.fingerprint)


def _combined(scene: Scene, job: _Job, parts: Mapping[str, Result]) -> Result:
    """Picture, summary and result of both analyses together."""
    folder, display = job.folder, job.display
    display.phase("output")
    if all(part.failed for part in parts.values()):
        draw_comparison(parts["dynamic"], parts["quasistatic"], folder)
    first = parts["dynamic"]
    summary = {"schema": first.summary["schema"], "case": scene.case, "mesh": first.summary["mesh"], "analysis": "both",
               **{name: part.summary for name, part in parts.items()}}
    write_summary(folder / SUMMARY, summary)
    display.update(1.0, str(folder))
    return Result(folder, scene, summary, first.history, first.state, dict(parts))


def _onset(folder: Path, fingerprint: str, observers: Sequence[Observer]) -> Loaded:
    """What a run with these observers has left of its loading."""
    name = next((observer.name for observer in observers if isinstance(observer, Strength)), Strength.__name__)
    memories = load_checkpoint(folder / Simulation.CHECKPOINT, fingerprint).memories
    return Loaded(load_state(folder / Simulation.ONSET, fingerprint), memories[f"observer {name}"])


def _run_one(scene: Scene, job: _Job, onset: Loaded | None = None) -> Result:
    """The run of a scene of one analysis, from `onset` on if there is one."""
    simulation = Simulation(scene, job.folder, job.display, job.resumes, job.observers, job.ranks)
    with simulation.notes:
        for note in job.notes:
            log.warning(note)
        if job.made_in_python and not job.resumes:
            log.warning("%s beside the results does not describe this run, parts of which were made in Python (%s): "
                        "it can be resumed and run again from there only", SCENE, ", ".join(job.made_in_python))
    if not job.resumes:
        simulation.checkpoint()  # from here on the run can be resumed, whenever it is killed
        _write_scene(scene, job.folder, job.made_in_python)
    with told(job.folder, job.display, lambda: simulation.notes.texts):
        _announce(simulation, job)
        try:
            state = simulation.run(onset)
        except SkfsinkError:
            _unfinished(simulation, job)
            raise
        return _finished(simulation, state, job)


def _unfinished(simulation: Simulation, job: _Job) -> None:
    """Pictures of a run that has stopped on its way; what goes wrong with them does not hide why it has stopped."""
    try:
        simulation.frames.close()
        if draw_what_there_is(simulation.scene, job.folder, simulation.frames.moments):
            job.display.say(f"pictures of what there is are in {job.folder}")
    except (SkfsinkError, OSError, ValueError) as failed:
        job.display.say(f"no pictures of the run so far: {first_line(failed)}")


def _announce(simulation: Simulation, job: _Job) -> None:
    """Say what is computed, and where."""
    scene = simulation.scene
    space = scene.sample.space
    for text in scene.sample.notes:
        job.display.say(f"note: {text}")
    linear = linear_of(scene)
    if ranks := ranks_text(scene.controls.analysis, scene.controls.integrator, linear):
        job.display.say(ranks)
    if scene.controls.statics.linear == AUTO and linear != "direct":
        job.display.say(f"equilibria by {linear}, which suits {space.X.size} displacements better than factors do; "
                        f"linear = 'direct' takes these")
    job.display.say(f"{scene.title}, mesh {scene.sample.name}: {space.n_elements} elements, "
                    f"{int(simulation.free.sum())} + {space.n_nodes} unknowns; {scene.controls.analysis} analysis in "
                    f"{job.folder}")


def _finished(simulation: Simulation, state: State, job: _Job) -> Result:
    """Pictures, summary and result of a run that has come to its end."""
    scene, folder, display = simulation.scene, job.folder, job.display
    display.phase("output")
    display.update(0.0, "")
    draw_run(scene, folder, "loading" if simulation.unfailed else "run", simulation.frames.moments)
    simulation.costs.lap("output")
    corridor = {}
    if scene.parameters.get("mesh_layout") == "two-pass":
        corridor["corridor"] = corridor_report(simulation, corridor_mesh(folder).parent)  # before the summary: it warns
    summary = {**summarize(scene, simulation), **corridor}
    if scene.controls.series == "vtkhdf":
        for name in ("run", "loading"):
            pack_series(folder / "series", name)
    write_summary(folder / SUMMARY, summary)
    display.update(1.0, str(folder))
    display.say(summary["verdict"])
    return Result(folder, scene, summary, History.load(folder / "history.csv"), state, {}, job.observers)
