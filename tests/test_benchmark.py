"""The benchmark, as CONTRIBUTING.md says to start it: what it measures is run by hand."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def test_benchmark_starts_from_the_checkout() -> None:
    """Fails if a module of the tests is not found, or a name that is not there is a traceback."""
    root = Path(__file__).parents[1]
    done = subprocess.run([sys.executable, "tests/benchmarks/benchmark.py", "step", "steps"], cwd=root, text=True,
                          capture_output=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("benchmark.py: steps is none of tangent, machine_limits, step, gamma, ")
    assert done.stderr.count("\n") == 1
