"""From the arguments of a case function to the files of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from .checkpoint import load_state
from .errors import OutputError, ParameterError
from .options import NOT_PHYSICS, Options
from .output import prepare_folder, write_atomic, write_summary
from .pictures import draw_comparison, draw_run
from .progress import Display
from .result import Result, summarize
from .scene import Scene, read_parameters
from .simulate import Simulation, onset_copy
from .state import State

__all__ = ["run_case"]

SceneMaker = Callable[[dict[str, Any], Options], Scene]


def run_case(case: str, make_scene: SceneMaker, own: dict[str, Any], options: Options) -> Result:
    """Run a case: `own` are the arguments of its function, `make_scene` turns them into a scene.

    With `options.resume` the arguments are those in that folder's `scene.toml`; any that was given besides must agree.
    """
    if options.resume is not None:
        own, options = _resumed(case, own, options)
    folder = options.resume or options.out or _default_folder(case, own, options)
    with Display(options.quiet) as display:
        if options.analysis != "both":
            return _run_one(make_scene, own, options, folder, display, None)
        return _run_both(case, make_scene, own, options, folder, display)


def _default_folder(case: str, own: dict[str, Any], options: Options) -> Path:
    name = f"{Path(own['mesh']).stem}-{options.analysis}"
    if options.analysis != "quasistatic" and options.integrator != "explicit":
        name += f"-{options.integrator}"
    return Path("results") / case / name


def _resumed(case: str, own: dict[str, Any], options: Options) -> tuple[dict[str, Any], Options]:
    folder = options.resume
    assert folder is not None
    stored = read_parameters(folder, case)
    defaults = Options()
    for name, value in options.parameters().items():
        if value != getattr(defaults, name) and value != stored.get(name):
            raise ParameterError(f"--{name.replace('_', '-')} {value} is not that of the run in {folder} "
                                 f"({stored.get(name)}); a resumed run keeps its scene")
    known = {f.name for f in fields(Options)} - set(NOT_PHYSICS)
    try:
        options = replace(options, **{k: v for k, v in stored.items() if k in known})
        own = {k: stored[k] for k in own}
    except (KeyError, TypeError) as error:
        raise OutputError(f"{folder / 'scene.toml'} is not the scene of a run: {error}") from None
    return own, options


def _run_both(case: str, make_scene: SceneMaker, own: dict[str, Any], options: Options, folder: Path,
              display: Display) -> Result:
    if options.resume is None:
        prepare_folder(folder, options.overwrite)
        write_atomic(folder / "scene.toml", make_scene(own, options).toml())
    parts: dict[str, Result] = {}
    onset: State | None = None
    for analysis in ("dynamic", "quasistatic"):
        part = folder / analysis
        resume = part if options.resume is not None and (part / Simulation.CHECKPOINT).exists() else None
        child = replace(options, analysis=analysis, out=None, resume=resume, overwrite=True)
        parts[analysis] = _run_one(make_scene, own, child, part, display, onset)
        dynamic_scene = parts["dynamic"].scene
        onset = load_state(folder / "dynamic" / Simulation.ONSET, dynamic_scene.fingerprint)
    display.phase("output")
    draw_comparison(parts["dynamic"], parts["quasistatic"], folder)
    first = parts["dynamic"]
    summary = {"schema": first.summary["schema"], "case": case, "mesh": first.summary["mesh"], "analysis": "both",
               **{name: part.summary for name, part in parts.items()}}
    write_summary(folder / "summary.json", summary)
    display.update(1.0, str(folder))
    return Result(folder, first.scene, summary, first.history, first.state, parts)


def _run_one(make_scene: SceneMaker, own: dict[str, Any], options: Options, folder: Path, display: Display,
             onset: State | None) -> Result:
    scene = make_scene(own, options)
    if options.resume is None:
        prepare_folder(folder, options.overwrite)
        (folder / Simulation.CHECKPOINT).unlink(missing_ok=True)
        write_atomic(folder / "scene.toml", scene.toml())
    simulation = Simulation(scene, folder, display, options.resume is not None)
    space = scene.sample.space
    display.say(f"{scene.title}, mesh {scene.sample.name}: {space.n_elements} elements, "
                f"{int(simulation.free.sum())} + {space.n_nodes} unknowns; {options.analysis} analysis in {folder}")
    state = simulation.run(None if onset is None else onset_copy(onset))
    display.phase("output")
    display.update(0.0, "")
    draw_run(scene, folder, simulation.recorder)
    simulation._lap("output")
    summary = summarize(scene, simulation)
    write_summary(folder / "summary.json", summary)
    display.update(1.0, str(folder))
    history: dict[str, np.ndarray] = type(simulation.recorder.history).load(folder / "history.csv")
    return Result(folder, scene, summary, history, state, {})
