"""What a run costs before its first step: compiled code must come from the cache, and only what the run needs."""

from __future__ import annotations

import ast
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import skfsink
from skfsink.system import scratch
from skfsink.system.jit import sources

PROBE = """
import importlib, pkgutil
import numpy as np, skfem
import numba.core.dispatcher as dispatcher
import skfsink.fem.kernels
from skfsink.material import AAA
from skfsink.fields.momentum import Momentum
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
space = Space(skfem.MeshQuad.init_tensor(*2 * [np.linspace(0, 1, 3)]))
for threads in (1, 2):
    skfsink.fem.kernels.Tiles.WORTH = 0
    momentum = Momentum(space, AAA(), threads=threads)
    momentum.force(np.zeros_like(space.X))
    momentum.stiffest(np.zeros_like(space.X), np.ones_like(space.X))
momentum.tangent(Pattern(space, 2), np.zeros_like(space.X))
compiled = {f"{module.name}.{name}": value
            for module in pkgutil.iter_modules(skfsink.fem.kernels.__path__, "skfsink.fem.kernels.")
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


@pytest.mark.slow
def test_a_start_compiles_what_it_needs_and_a_second_one_nothing(tmp_path: Path) -> None:
    """Fails if a loop cannot be cached, as one that closes over other compiled functions, or a plate compiles 3D loops.

    Either cost 6 s a start.
    """
    first, names = start(tmp_path)
    assert first >= 4
    assert not [name for name in names if "3d" in name or "plane_stress" in name], names
    assert start(tmp_path) == (0, names)


def processor_time(*arguments: str) -> float:
    """Least processor time that Python takes with these arguments [s]; of three, as other processes disturb caches."""
    def once() -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, *arguments], capture_output=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    return min(once() for _ in range(3))


def test_a_start_takes_no_time() -> None:
    """Fails if `import skfsink` takes more than 0.1 s, or the help of the program 0.6 s, of the processor."""
    assert processor_time("-c", "import skfsink") - processor_time("-c", "") < 0.1
    assert processor_time("-m", "skfsink", "--help") < 0.6


# --- what makes a compiled loop old ---
FORCE = """
import numpy as np, skfem
from skfsink.material import NeoHookean
from skfsink.fields.momentum import Momentum
from skfsink.fem.space import Space
momentum = Momentum(Space(skfem.MeshQuad.init_tensor(*2 * [np.linspace(0, 1, 3)])), NeoHookean())
momentum.force(np.zeros_like(momentum.space.X))
print(momentum.energy, len(list(__import__("pathlib").Path(r"CACHE").rglob("force_2d*"))))
"""


def copied(folder: Path) -> Path:
    """A copy of the package."""
    shutil.copytree(Path(skfsink.__file__).parent, folder / "skfsink", ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def test_units_as_the_program_has_them_are_read_without_a_library() -> None:
    """Fails if a grip in mm/s makes a start load pint, which takes half a second."""
    probe = ("import sys; from skfsink.scene.tables import read_tables; "
             "read_tables('grips', [{'boundary': 'top', 'y': '1 mm/s'}]); print('pint' in sys.modules)")
    ran = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "False"


@pytest.mark.slow
def test_a_change_in_an_imported_module_is_seen(tmp_path: Path) -> None:
    """Fails if a loop is read from the cache although what was built into it has changed in another file.

    Nor may a loop that has changed leave its old file behind.
    """
    lanes = copied(tmp_path) / "skfsink" / "fem" / "kernels" / "lanes.py"
    cache = tmp_path / "cache"

    def energy() -> tuple[float, int]:
        ran = subprocess.run([sys.executable, "-c", FORCE.replace("CACHE", str(cache))], capture_output=True, text=True,
                             check=True, cwd=tmp_path, env={**os.environ, "NUMBA_CACHE_DIR": str(cache)})
        value, files = ran.stdout.split()
        return float(value), int(files)

    first, files = energy()
    assert abs(first) < 1e-12
    times = lanes.stat()
    lanes.write_text(lanes.read_text().replace("r[i] = s * s\n", "r[i] = 2 * s\n"))
    os.utime(lanes, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert lanes.stat().st_size == times.st_size
    second, left = energy()
    assert second > 0.1 and left == files


def test_stamps_cover_what_modules_import() -> None:
    """Fails if a module from which a compiled loop takes a name does not count, or a loop goes past the package's njit.

    The modules are found here by Python's own parser.
    """
    package = Path(skfsink.__file__).parent
    for file in package.rglob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        found = {file}
        for node in tree.body:
            if not isinstance(node, ast.ImportFrom):
                continue
            if node.module == "numba" and file.name != "jit.py":
                assert not {name.name for name in node.names} & {"njit", "jit"}, file
            if node.level:
                base = file.parents[node.level - 1].joinpath(*(node.module or "").split("."))
                places = [base, *(base / name.name for name in node.names)]
                found |= {path for place in places for path in (place.with_name(f"{place.name}.py"),
                                                                place / "__init__.py") if path.is_file()}
        assert found <= set(sources(file)), file
    lanes, loop = (package / "fem" / "kernels" / name for name in ("lanes.py", "force3d.py"))
    assert lanes in sources(loop) and lanes not in sources(package / "material" / "isotropic.py")


# --- where nothing can be written ---
AWAY = """
import skfsink, numpy as np
from skfsink.material import NeoHookean, isotropic
import skfsink.pictures.plot
NeoHookean().shear_modulus
import matplotlib
print(isotropic._neo_hookean_law.stats.cache_path, sum(isotropic._neo_hookean_law.stats.cache_misses.values()),
      matplotlib.get_configdir(), sep="|")
"""


@pytest.mark.slow
@pytest.mark.parametrize("home", ["read-only", "none", "writable"])
def test_a_read_only_install_keeps_its_loops_in_a_temporary_folder(home: str, tmp_path: Path) -> None:
    """Fails if the program does not start where neither it nor the home folder can be written, or says so not once.

    Nor may it compile anew at the next start, or leave a place that can be written.
    """
    top = copied(tmp_path)
    held = [sys.executable]
    if os.geteuid() == 0:  # root writes everywhere unless that power is taken from it
        if not (setpriv := shutil.which("setpriv")):
            pytest.skip("root writes everywhere")
        held = [setpriv, "--bounding-set=-dac_override,-dac_read_search", sys.executable]
        if subprocess.run([*held, "-c", ""], capture_output=True, check=False).returncode:
            pytest.skip("root writes everywhere")
    for name in ("home", "tmp"):
        (top / name).mkdir()
    environment = {k: v for k, v in os.environ.items()
                   if not k.startswith(("NUMBA_", "MPLCONFIGDIR", "XDG_")) and k != "HOME"}
    environment |= {"TMPDIR": str(top / "tmp"), "HOME": "/proc/no/home" if home == "none" else str(top / "home")}
    environment |= {"PYTHONDONTWRITEBYTECODE": "1"}
    folders = [path for path in (top / "skfsink").rglob("*") if path.is_dir()] + [top / "skfsink"]
    if home == "read-only":
        folders.append(top / "home")
    for folder in folders:
        folder.chmod(0o555)
    try:
        ran = [subprocess.run([*held, "-c", AWAY], capture_output=True, text=True, check=False, cwd=top,
                              env=environment)
               for _ in range(2)]
    finally:
        for folder in folders:
            folder.chmod(0o755)
    for number, process in enumerate(ran):
        assert process.returncode == 0, process.stderr
        place, missed, fonts = process.stdout.strip().split("|")
        assert int(missed) == (number == 0)
        if home == "writable":
            assert process.stderr == "" and place.startswith(str(top / "home"))
        else:
            assert process.stderr.startswith("the home folder cannot be written") and process.stderr.count("\n") == 1
            assert place.startswith(str(top / "tmp")) and fonts.startswith(str(top / "tmp"))
    if home == "writable":
        assert not [*(top / "tmp").iterdir()]
    else:
        kept, = (top / "tmp").iterdir()
        assert not kept.stat().st_mode & 0o077


def test_a_temporary_folder_of_others_is_not_trusted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if compiled code is read from a folder that anybody may write to, or through a link."""
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    named = tmp_path / f"skfsink-{os.getuid()}"
    for number in range(2):
        if number:
            named.rmdir(), (tmp_path / "there").mkdir(mode=0o700), named.symlink_to(tmp_path / "there")
        else:
            named.mkdir(), named.chmod(0o777)
        scratch.temporary_folder.cache_clear()
        found = scratch.temporary_folder()
        assert found is not None and found != named and found.is_dir()
    scratch.temporary_folder.cache_clear()
