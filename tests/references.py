"""Made-up runs and references of the cases: a straight crack across the coarse mesh of each, in the files of a run."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from skfsink.results import reference
from skfsink.results.frame import Frame
from skfsink.results.history import History
from skfsink.results.series import Series
from skfsink.results.summary import write_summary
from skfsink.scene.options import Options
from skfsink.scene.registry import find_case
from skfsink.scene.scene import Scene

FIGURES = Path(__file__).resolve().parents[1] / "figures"
if str(FIGURES) not in sys.path:
    sys.path.append(str(FIGURES))
MOMENTS = {"onset": 0, "branching": 2, "arrival": 3, "end": 5}
TIPS = (0.0, 0.4, 0.6, 1.0, 1.0, 1.0)   # of the crack in the frames, as shares of the way
STEP = 5e-6                             # between the frames [s]


def scene_of(case: str, analysis: str = "dynamic", **dimensions: Any) -> Scene:
    """The scene of a case on its coarse mesh."""
    found = find_case(case)
    return found.scene({**found.default_arguments, "mesh": "coarse", **dimensions}, Options(analysis=analysis))


def cracked(scene: Scene, tip: float, time: float = 1e-5, opening: float = 0.05) -> Frame:
    """A straight open crack over the share `tip` of its way; spent nodes are wherever they like."""
    X, l = scene.sample.space.X, 0.1
    if scene.case == "cylindrical_shell":
        across, along = X[:, 2] - np.ptp(X[:, 2]) / 2, np.abs(np.arctan2(X[:, 1], X[:, 0]) / (np.pi / 2) - 1)
    elif scene.case == "dog_bone":
        across, along = X[:, 1] - scene.parameters["gauge_length"] / 2, 1 - np.abs(X[:, 0]) / 0.75
    else:
        across, along = X[:, 1] - np.ptp(X[:, 1]) / 2, X[:, 0] / np.ptp(X[:, 0])
    ahead = np.maximum(along - tip, 0) * 4.0
    gamma = np.maximum(1 - np.exp(-np.hypot(ahead, np.maximum(np.abs(across) - l, 0)) / l), 1e-15)
    axis = 2 if scene.case == "cylindrical_shell" else 1
    u = np.zeros_like(X)
    u[:, axis] = opening * np.sign(across) * np.clip(4 * (tip - along), 0, 1) + 0.05 * across
    v = 2e4 * np.exp(-np.abs(across))[:, None] * np.eye(X.shape[1])[axis] * np.sign(across)[:, None]
    spent = gamma < 1e-2
    u[spent] += np.random.default_rng(0).normal(size=(int(spent.sum()), X.shape[1]))
    deleted = (gamma[scene.sample.space.conn] < 1e-6).all(axis=1)
    return Frame(time, "", u, gamma, deleted, v)


def write_run(folder: Path, scene: Scene) -> Path:
    """A finished run in a folder; returns the folder."""
    quasistatic = scene.controls.analysis == "quasistatic"
    (folder / "series").mkdir(parents=True)
    space = scene.sample.space
    series, history = Series(folder / "series", "run", space), History(folder / "history.csv", dim=space.dim)
    history.append({"phase": "loading", "elastic": 0.05, "step": 1})
    for i, tip in enumerate(TIPS):
        frame = cracked(scene, tip)
        series.add(float(i) if quasistatic else i * STEP,
                   {"displacement": frame.u, "velocity": frame.v, "gamma": frame.gamma},
                   {"deleted": frame.deleted.astype(np.int8)})
        history.append({"phase": "event", "step": i, "time_s": 0.0 if quasistatic else i * STEP, "elastic": 0.05,
                        "crack_length_mm": 3 * tip, "U_paper": 0.06 * tip})
    series.flush()
    share = 0.6 if quasistatic else 1.0
    write_summary(folder / "summary.json", {
        "schema": 1, "case": scene.case, "mesh": scene.sample.name, "analysis": scene.controls.analysis,
        "elements": scene.sample.space.n_elements, "onset": {"displacement_mm": 0.13},
        "event": {"max_branches": 2, "mean_tip_speed_m_per_s": None if quasistatic else 27.0},
        "energy": {"U_paper_at_arrival": 0.06 * share, "U_paper_final": 0.065 * share,
                   "D_sink_at_arrival": 0.03 * share, "D_sink_final": 0.031 * share, "D_sink_kinetic": 0.01 * share},
        "moments": {k: v for k, v in MOMENTS.items() if not (quasistatic and k == "branching")}})
    scene.stored().write(folder)
    return folder


def fill(root: Path, runs: Path) -> None:
    """Store a made-up reference for each of the runs that the figures are drawn from, below `root`."""
    from runs import COARSE, RUNS

    folders: dict[tuple[str, str], Path] = {}
    for run in RUNS:
        if run.key == COARSE:
            continue
        made = (run.case, run.arguments[run.arguments.index("--analysis") + 1])
        if made not in folders:
            folders[made] = write_run(runs / "-".join(made), scene_of(*made))
        reference.store(folders[made], root / run.case / "reference" / run.key, run.frames, run.velocity)
