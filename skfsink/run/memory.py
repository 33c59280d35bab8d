"""Memory that a run will need, estimated from its mesh before anything is computed."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from ..errors import ParameterError, require
from ..fem.space import Space
from ..scene.scene import Scene
from .display import Display

__all__ = ["LIMIT", "available", "check_memory", "estimate", "factor_entries"]

LIMIT = "SKFSINK_MEMORY_GB"  #: environment variable: memory that a run may use [GB], instead of what is found
LEAF = 60           # elements that dissection does not divide further
WORTH_SAYING = 1.0  # GB
# Peaks of the committed reference runs, 0.6 to 3.0 GB, are met within a factor of 1.25 by these:
PROGRAM = 0.35                       # GB, with its libraries
PER_ELEMENT = {2: 19e-6, 3: 10e-6}   # GB, fields, matrices, pictures
FACTORS = 1.25                       # of the matrix of equilibrium: more than one where it is not positive definite too
MULTIGRID = {2: 5e-6, 3: 26e-6}      # GB, hierarchy and whole matrix in the place of factors, of large bodies
WITHOUT_FACTORS = "multigrid", "petsc-gamg"  # values of `linear`


def estimate(space: Space, statics: bool = True, linear: str = "direct") -> float:
    """Greatest memory [GB] that a run on this mesh takes, of the whole process; without `statics` it has no factors."""
    bare = float(PROGRAM + PER_ELEMENT[space.dim] * space.n_elements)
    if not statics:
        return bare
    if linear in WITHOUT_FACTORS:
        return bare + MULTIGRID[space.dim] * space.n_elements
    entries = factor_entries(space) if space.dim == 3 else 4.5 * space.n_nodes * np.log2(space.n_nodes)
    return float(bare + FACTORS * 8e-9 * space.dim**2 * entries)


def available() -> float:
    """Memory [GB] that this process can have, with what it has: of the machine, or of its control group."""
    if asked := os.environ.get(LIMIT):
        number: Any = asked
        with suppress(ValueError):
            number = float(asked)
        return require(LIMIT, number, "GB", low=0, low_open=True)
    free = [psutil.virtual_memory().available]
    for folder in _groups():
        for limit, usage in (("memory.max", "memory.current"), ("memory.limit_in_bytes", "memory.usage_in_bytes")):
            with suppress(OSError, ValueError):  # no such file, or no limit: "max"
                free.append(max(int((folder / limit).read_text()) - int((folder / usage).read_text()), 0))
    return float(min(free) + psutil.Process().memory_info().rss) / 1e9


def check_memory(scene: Scene, display: Display) -> None:
    """Say how much memory a large run will need.

    Raises
    ------
    ParameterError
        It is more than there is.
    """
    space, there = scene.sample.space, available()
    linear, statics = scene.controls.statics.linear, scene.event_at > 0.0 or scene.controls.integrator != "explicit"
    needed = estimate(space, statics, linear)
    if needed > there:
        cure = f"take a coarser mesh or a larger machine, or set {LIMIT} to what it may use"
        if statics and (less := estimate(space, True, "multigrid")) < there:
            cure = f"take linear = 'multigrid', which needs {less:.1f} GB, or{cure[4:]}"
        raise ParameterError(f"the run will need about {needed:.1f} GB of memory for {space.n_elements} elements, and "
                             f"there are {there:.1f} GB; {cure}")
    if needed >= WORTH_SAYING:
        display.say(f"the run will need about {needed:.1f} GB of memory; there are {there:.1f} GB")


def _groups() -> list[Path]:
    """Folders of the control groups that limit the memory of this process, Linux only."""
    root, found = Path("/sys/fs/cgroup"), []
    with suppress(OSError):
        for line in Path("/proc/self/cgroup").read_text().splitlines():
            _, kinds, path = line.split(":", 2)
            if kinds in ("", "memory"):
                inner = Path(path.lstrip("/"))
                found += [root / kinds / part for part in (inner, *inner.parents)]
    return found


def factor_entries(space: Space, elements: np.ndarray | None = None, done: np.ndarray | None = None) -> float:
    """Entries of the Cholesky factor of a scalar matrix on the mesh, ordered by nested dissection.

    The elements are halved across their longest extent again and again; the nodes that two halves share are the
    separator, eliminated after both, together with the separators around them.
    """
    if elements is None or done is None:
        elements, done = np.arange(space.n_elements), np.zeros(space.n_nodes, bool)
    conn = space.conn[elements]
    nodes = np.unique(conn)
    around = int(done[nodes].sum())
    if len(elements) <= LEAF:
        inner = len(nodes) - around
        return inner * (inner / 2 + around)
    middle = space.X[conn].mean(axis=1)
    order = np.argsort(middle[:, np.ptp(middle, axis=0).argmax()], kind="stable")
    halves = elements[order[:len(order) // 2]], elements[order[len(order) // 2:]]
    shared = np.intersect1d(space.conn[halves[0]], space.conn[halves[1]])
    shared = shared[~done[shared]]
    inner = len(shared)
    done[shared] = True
    below = sum(factor_entries(space, half, done) for half in halves)
    done[shared] = False
    return below + inner * (inner / 2 + around)
