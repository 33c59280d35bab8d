"""Systems without what only some have: `fcntl`, `resource`, user numbers. The package imports, runs and locks there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from plates import SMALL, plate

from skfsink.meshing.vtu import write_mesh

#: hides what Windows does not have; psutil needs `resource` itself where there is one, and is imported before
HIDE = """
import os, sys, psutil, warnings
for name in ("fcntl", "resource", "pwd", "grp", "termios"):
    sys.modules[name] = None
for name in ("getuid", "geteuid", "fork", "sched_getaffinity", "killpg", "mkfifo"):
    if hasattr(os, name):
        delattr(os, name)
warnings.filterwarnings("ignore", "only soft file lock")
"""
EVERY = """
import importlib, pkgutil, skfsink
for module in pkgutil.walk_packages(skfsink.__path__, "skfsink."):
    importlib.import_module(module.name)
    print(module.name)
"""
RUN = """
import sys
from skfsink.cases.single_edge_notch import single_edge_notch
from skfsink.cli.program import command
command(single_edge_notch, sys.argv[1:])
"""
LOCKED = """
import sys
from pathlib import Path
from skfsink.errors import OutputError
from skfsink.run.occupied import occupied
folder = Path(sys.argv[1])
with occupied(folder) as warning:
    assert not warning, warning
    try:
        with occupied(folder):
            print("two runs in one folder")
    except OutputError as error:
        assert "is in use by another run" in str(error), error
print(*folder.iterdir())
"""


def started(program: str, *arguments: object) -> str:
    """What a program in a process of its own prints, without an error."""
    ran = subprocess.run([sys.executable, "-c", program, *map(str, arguments)], capture_output=True, text=True,
                         env={**os.environ, "MPLBACKEND": "Agg"})
    assert (ran.returncode, ran.stderr) == (0, ""), ran.stderr
    return ran.stdout


@pytest.mark.slow
def test_every_module_imports() -> None:
    """Fails if a module needs at its import what the system does not have."""
    assert len(started(HIDE + EVERY).split()) > 200


@pytest.mark.slow
def test_a_run_is_the_same(tmp_path: Path) -> None:
    """Fails if a run does not end there, has other results or other files, or says no memory that it took."""
    write_mesh(tmp_path / "plate.vtu", plate())
    for folder, program in (("with", RUN), ("without", HIDE + RUN)):
        started(program, "--mesh", tmp_path / "plate.vtu", "--event-time", "1e-6", *SMALL, "--out", tmp_path / folder)
    files = [{path.relative_to(tmp_path / folder) for path in (tmp_path / folder).rglob("*")}
             for folder in ("with", "without")]
    assert files[0] == files[1]
    assert (tmp_path / "with/history.csv").read_bytes() == (tmp_path / "without/history.csv").read_bytes()
    assert json.loads((tmp_path / "without/summary.json").read_text())["cost"]["peak_rss_mb"] > 50


def test_a_folder_is_locked(tmp_path: Path) -> None:
    """Fails if two runs get into one folder there, or the lock leaves something."""
    assert started(HIDE + LOCKED, tmp_path / "run") == "\n"
