"""What a run costs before its first step: compiled code must come from the cache, and only what the run needs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

PROBE = """
import importlib, pkgutil
import numpy as np, skfem
import numba.core.dispatcher as dispatcher
import skfsink.kernels
from skfsink.material import AAA
from skfsink.momentum import Momentum
from skfsink.pattern import Pattern
from skfsink.space import Space
space = Space(skfem.MeshQuad.init_tensor(*2 * [np.linspace(0, 1, 3)]))
for threads in (1, 2):
    skfsink.kernels.Tiles.WORTH = 0
    momentum = Momentum(space, AAA(), threads=threads)
    momentum.force(np.zeros_like(space.X))
    momentum.stiffest(np.zeros_like(space.X), np.ones_like(space.X))
momentum.tangent(Pattern(space, 2), np.zeros_like(space.X))
compiled = {f"{module.name}.{name}": value
            for module in pkgutil.iter_modules(skfsink.kernels.__path__, "skfsink.kernels.")
            for name, value in vars(importlib.import_module(module.name)).items()
            if isinstance(value, dispatcher.Dispatcher) and value.signatures and value.stats.cache_path}
print(sum(sum(d.stats.cache_misses.values()) for d in compiled.values()), *compiled)
"""


def start(cache: Path) -> tuple[int, list[str]]:
    """Loops that were compiled instead of read from the cache, and the names of those in use, in a new process."""
    ran = subprocess.run([sys.executable, "-c", PROBE], capture_output=True, text=True, check=True,
                         env={**os.environ, "NUMBA_CACHE_DIR": str(cache)})
    missed, *names = ran.stdout.split()
    return int(missed), names


def test_a_start_compiles_what_it_needs_and_a_second_one_nothing(tmp_path: Path) -> None:
    """Fails if a loop cannot be cached, as one that closes over other compiled functions, or a plate compiles 3D loops.

    Either cost 6 s a start.
    """
    first, names = start(tmp_path)
    assert first >= 4
    assert not [name for name in names if "3d" in name or "plane_stress" in name], names
    assert start(tmp_path) == (0, names)
