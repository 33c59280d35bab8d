"""Memory that a run will need, estimated from its mesh before anything is computed."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from ..errors import ParameterError, require
from ..fem.linear import AUTO, linear_for
from ..fem.space import Space
from ..methods.step_length import StepLength
from ..scene.scene import Scene
from .checks import is_viscous
from .display import Display

__all__ = ["LIMIT", "available", "check_memory", "estimate", "has_statics", "linear_of"]

LIMIT = "SKFSINK_MEMORY_GB"  #: environment variable: memory that a run may use [GB], instead of what is found
WORTH_SAYING = 1.0  # GB
# Peaks of the committed reference runs, 0.6 to 3.0 GB, are met within a factor of 1.25 by these:
PROGRAM = 0.35                       # GB, with its libraries
PER_ELEMENT = {2: 19e-6, 3: 10e-6}   # GB, fields, matrices, pictures
FACTORS = 1.25                       # of the matrix of equilibrium: more than one where it is not positive definite too
NO_MATRIX = 4.5e-6                   # GB, an element of a large solid less, whose explicit steps need no matrix
#: by value of `linear`: GB an element, hierarchy and whole matrix in the place of factors, of large bodies
HIERARCHIES = {"multigrid": {2: 5e-6, 3: 26e-6}, "petsc-gamg": {2: 5e-6, 3: 10e-6}}


def estimate(space: Space, statics: bool = True, linear: str = "direct", viscous: bool = False) -> float:
    """Greatest memory [GB] that a run on this mesh takes, of the whole process; without `statics` it has no factors."""
    bare = float(PROGRAM + PER_ELEMENT[space.dim] * space.n_elements)
    if not statics:
        large = space.dim == 3 and space.X.size > StepLength.ASSEMBLED and not viscous
        return bare - NO_MATRIX * space.n_elements * large
    if linear in HIERARCHIES:
        return bare + HIERARCHIES[linear][space.dim] * space.n_elements
    entries = space.factor_entries if space.dim == 3 else 4.5 * space.n_nodes * np.log2(space.n_nodes)
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
    linear, statics = linear_of(scene), has_statics(scene)
    needed = estimate(space, statics, linear, is_viscous(scene))
    if needed > there:
        cure = f"take a coarser mesh or a larger machine, or set {LIMIT} to what it may use"
        if statics and (less := estimate(space, True, "multigrid")) < there:
            cure = f"take linear = 'multigrid', which needs {less:.1f} GB, or{cure[4:]}"
        raise ParameterError(f"the run will need about {needed:.1f} GB of memory for {space.n_elements} elements, and "
                             f"there are {there:.1f} GB; {cure}")
    if needed >= WORTH_SAYING:
        display.say(f"the run will need about {needed:.1f} GB of memory; there are {there:.1f} GB")


def linear_of(scene: Scene) -> str:
    """What solves for the equilibria of a scene, a name in :data:`.LINEAR`; for one without them no factor is sized."""
    asked = scene.controls.statics.linear
    return linear_for(asked, scene.sample.space) if has_statics(scene) or asked != AUTO else "direct"


def has_statics(scene: Scene) -> bool:
    """Whether a scene has equilibria or implicit steps."""
    return scene.event_at > 0.0 or scene.controls.integrator != "explicit"


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
