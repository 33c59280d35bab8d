"""A script on several ranks: `mpiexec -n 4 python -m skfsink.methods.ranks script.py ...`.

The first rank runs the script; the others compute their parts of the events that it starts.
"""

from __future__ import annotations

import runpy
import sys

from ...errors import SkfsinkError
from .crew import lead
from .world import first, world


def main() -> None:
    """Run the script that the command line names, with the arguments behind it."""
    if len(sys.argv) < 2:
        if first():
            print("skfsink: name a script: mpiexec -n 4 python -m skfsink.methods.ranks script.py", file=sys.stderr)
        raise SystemExit(2)
    try:
        comm = world()
    except SkfsinkError as error:
        if first():
            print("skfsink:", error, file=sys.stderr)
        raise SystemExit(2) from None
    sys.argv = sys.argv[1:]
    if comm is None:
        runpy.run_path(sys.argv[0], run_name="__main__")
    else:
        lead(comm, lambda: runpy.run_path(sys.argv[0], run_name="__main__"))


if __name__ == "__main__":
    main()
