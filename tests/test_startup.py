"""What a run costs before its first step: compiled code must come from the cache."""

from __future__ import annotations

import subprocess
import sys

PROBE = """
import importlib, pkgutil
import numba.core.dispatcher as dispatcher
import skfsink.kernels
compiled = [value for module in pkgutil.iter_modules(skfsink.kernels.__path__, "skfsink.kernels.")
            for value in vars(importlib.import_module(module.name)).values()
            if isinstance(value, dispatcher.Dispatcher) and value.signatures]
print(len(compiled), sum(sum(d.stats.cache_misses.values()) for d in compiled))
"""


def test_a_second_start_compiles_no_element_loop():
    """Fails if a loop cannot be cached, as one that closes over other compiled functions: it costs 6 s a start."""
    for _ in range(2):
        ran = subprocess.run([sys.executable, "-c", PROBE], capture_output=True, text=True, check=True)
    loops, missed = map(int, ran.stdout.split())
    assert loops >= 4
    assert missed == 0
