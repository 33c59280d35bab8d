"""A script on several ranks: `mpiexec -n 4 python -m skfsink.methods.ranks script.py ...`.

The first rank runs the script; the others compute their parts of the events that it starts.
"""

from __future__ import annotations

import runpy
import sys

from .world import on_all_ranks


def script() -> None:
    """Run the script that the command line names, with the arguments behind it."""
    if len(sys.argv) < 2:
        print("skfsink: name a script: mpiexec -n 4 python -m skfsink.methods.ranks script.py", file=sys.stderr)
        raise SystemExit(2)
    sys.argv = sys.argv[1:]
    runpy.run_path(sys.argv[0], run_name="__main__")


if __name__ == "__main__":
    on_all_ranks(script)
