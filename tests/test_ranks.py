"""Bodies in parts on several ranks: the parts, and whole runs by `mpiexec`, killed and resumed on other numbers."""

from __future__ import annotations

import csv
import importlib.util
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bodies import Weight, box
from plates import SMALL, invoke, plate

from skfsink import load
from skfsink.errors import ParameterError
from skfsink.fem.space import Space
from skfsink.fields.density import DensitySolver
from skfsink.loads import BodyForce, Grip
from skfsink.loads.schedule import Loading
from skfsink.material import SinkLaw
from skfsink.meshing.vtu import write_mesh
from skfsink.methods.ranks.part import check_parts
from skfsink.methods.ranks.parted import Parted, write_parts
from skfsink.methods.ranks.partition import mesh_of, numbers, partition
from skfsink.scene.controls import Controls
from skfsink.study.ranks_scenes import compared, table

HERE = Path(__file__).resolve().parent
MPIEXEC = shutil.which("mpiexec", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]))
ranks = pytest.mark.skipif(MPIEXEC is None or importlib.util.find_spec("mpi4py") is None,
                           reason="no mpi4py with its mpiexec: install the extra mpi")
metis = pytest.mark.skipif(importlib.util.find_spec("pymetis") is None, reason="no pymetis: install the extra mpi")
ARGUMENTS = [*SMALL, "--analysis", "dynamic", "--event-time", "4e-5", "--density-solver", "jacobi",
             "--checkpoint-every", "0.05"]


def on(count: int, *arguments: str | Path) -> list[str]:
    """A command of Python on some ranks."""
    return [str(MPIEXEC), "-n", str(count), sys.executable, *map(str, arguments)]


def case(*arguments: str | Path) -> list[str | Path]:
    """Arguments of Python for a run of the notched plate."""
    return ["-m", "skfsink.cases.single_edge_notch", *arguments]


def case_alone(*arguments: str | Path) -> list[str]:
    """A command of Python for a run of the notched plate on one rank."""
    return [sys.executable, *map(str, case(*arguments))]


def finished(command: list[str], status: int = 0) -> str:
    """What a command that ends with a status says of errors."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=500, check=False, cwd=HERE.parent)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stderr


# --- the parts ---
@metis
@pytest.mark.parametrize("parts", [2, 3, 7])
def test_every_element_is_in_one_part_and_every_node_counts_once(space: Space, parts: int) -> None:
    """Fails if an element or a node is lost or counted twice, or two parts order the nodes between them differently."""
    found = numbers(space.conn, partition(space.conn, parts))
    assert len(found) == parts
    assert sorted(np.concatenate([part.elements for part in found]).tolist()) == list(range(space.n_elements))
    assert sorted(np.concatenate([part.nodes[:part.counted] for part in found]).tolist()) == list(range(space.n_nodes))
    for p, part in enumerate(found):
        assert set(part.nodes) == set(space.conn[part.elements].ravel())
        for q, nodes in part.shared.items():
            other = found[q]
            assert (part.nodes[nodes] == other.nodes[other.shared[p]]).all()
            assert set(part.nodes[nodes]) == set(part.nodes) & set(other.nodes)


@metis
def test_parts_are_even_and_their_borders_short() -> None:
    """Fails if METIS gets another graph than that of elements with a common side."""
    space = box("quad", 20, 0.0)
    part = partition(space.conn, 2)
    assert abs(np.bincount(part) - 200).max() <= 8
    shared = numbers(space.conn, part)[0].shared[1]
    assert shared.size <= 30  # 21 across the middle


def test_a_load_that_does_not_know_parts() -> None:
    """Fails if a load of your own is left out on several ranks, or refused after the body is loaded."""
    space = box("quad", 3)
    held = (np.flatnonzero(space.X[:, 1] == 0.0), Grip("bottom", (0.0, 0.0)))
    known = Loading(space, [held], others=[BodyForce(space, 1e-9, (0.0, 1.0))])
    check_parts(space, known, Controls())
    own = Loading(space, [held], others=[BodyForce(space, 1e-9, (0.0, 1.0)), Weight(space, 1.0)])
    with pytest.raises(ParameterError, match=r"^several ranks .* loads of the kind Weight, which has no of_part: "):
        check_parts(space, own, Controls())


@metis
def test_more_ranks_than_elements() -> None:
    """Fails if a rank may be left without a part."""
    with pytest.raises(ParameterError, match="30 ranks cannot share 25 elements: start at most as many"):
        partition(box("quad", 5).conn, 30)
    assert sorted(np.unique(partition(box("quad", 2).conn, 4))) == [0, 1, 2, 3]


def test_the_diagonal_preconditions_as_well_as_multigrid(space: Space) -> None:
    """Fails if conjugate gradients with the diagonal come to another density, with points that are dead."""
    law = SinkLaw(length_scale=0.3)
    W_max = np.zeros_like(space.w)
    W_max[:3] = [[1e3 * law.phi], [1.2 * law.phi], [law.phi]]
    one = np.ones(space.n_nodes)
    expected = DensitySolver(space, law, tolerance=1e-12).solve(W_max, one)
    jacobi = DensitySolver(space, law, tolerance=1e-12, solver="jacobi")
    assert np.abs(jacobi.solve(W_max, one) - expected).max() < 1e-11
    assert 0 < jacobi.iterations < 100


def test_an_unknown_solver_of_the_density(tmp_path: Path) -> None:
    """Fails if a word is taken that means nothing."""
    status, said, _ = invoke("--density-solver", "amg", "--out", tmp_path / "run")
    assert (status, said) == (2, "skfsink: density_solver must be one of multigrid, jacobi; got 'amg'\n")


def test_differences_are_told_before_and_after_the_first_branch() -> None:
    """Fails if what rounding does after a crack has branched counts as before, or a tip that one run lacks as none."""
    def event(branched: float, tip: float) -> SimpleNamespace:
        D = np.array([0.0, 1.0, 2.0, branched])
        table = {"time_s": np.arange(4.0), "branches": np.array([0, 2, 2, 3]), "sink_stored": D, "sink_kinetic": 0 * D,
                 "tip_x_mm": np.array([np.nan, 1.0, tip, 3.0]), "tip_y_mm": D, "tip_z_mm": np.full(4, np.nan),
                 "crack_length_mm": 0 * D}
        return SimpleNamespace(event=table, summary={
            "onset": {"elastic_energy": 2.0, "displacement_mm": 1.0, "place_mm": [0.0]},
            "energy": {"D_sink_final": branched, "balance_error_relative": 1e-15}, "deleted_elements": 3,
            "event": {"first_arrival_s": None, "max_branches": 3}})

    found = compared(event(4.0, 2.0), event(5.0, 2.0))
    assert (found["branched_s"], found["rows"], found["D_before"], found["tips_before_mm"]) == (3.0, 3, 0.0, 0.0)
    assert (found["D_end"], found["tips_end_mm"], found["arrival_end"], found["onset"]) == (0.25, 1.0, 0.0, 0.0)
    assert compared(event(4.0, 2.0), event(4.0, np.nan))["tips_before_mm"] == np.inf
    (row,) = [line for line in table({"event/a_b": {**found, "elements": 9, "again": True}}) if "a b" in line]
    assert row.startswith("| a b | 9 | 0.0e+00 | 3000000.0 |")
    assert row.endswith("| 2.5e-01 | 3, 3; 3, 3 | 1.0e-15 | yes |")
# --- parts in a folder ---
@pytest.fixture(scope="module")
def parted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A deck of the notched plate, and a folder with its parts for two ranks."""
    folder = tmp_path_factory.mktemp("parted")
    deck, parts, mesh = folder / "scene.toml", folder / "parts", folder / "plate.vtu"
    write_mesh(mesh, plate())
    deck.write_text(f'case = "single_edge_notch"\n[parameters]\nmesh = "{mesh}"\nanalysis = "dynamic"\n'
                    'length_scale = 0.6\nevent_time = 4e-6\ndensity_solver = "jacobi"\nrecord_every = 1e-6\n',
                    encoding="utf-8")
    finished([sys.executable, "-m", "skfsink", "partition", str(deck), "-n", "2", "--out", str(parts)])
    return deck, parts


@metis
def test_parts_in_a_folder_are_those_of_the_body(space: Space, tmp_path: Path) -> None:
    """Fails if a part comes back with other elements, nodes, neighbours or another mesh."""
    write_parts(space, 3, tmp_path / "parts")
    found = Parted(tmp_path / "parts")
    found.check(space, 3)
    for number, part in enumerate(numbers(space.conn, partition(space.conn, 3))):
        own, mesh = found.part(number)
        alone, expected = found.numbers(number), mesh_of(space, part)
        assert own.counted == alone.counted == part.counted and own.shared.keys() == part.shared.keys()
        for one, other in ((own.elements, part.elements), (own.nodes, part.nodes), (alone.elements, part.elements),
                           (alone.nodes, part.nodes), (mesh.p, expected.p), (mesh.t, expected.t),
                           *((own.shared[rank], part.shared[rank]) for rank in part.shared)):
            assert np.array_equal(one, other)
        assert np.array_equal(Space(mesh).w, space.w[part.elements])


@metis
def test_parts_that_do_not_fit_are_refused_in_one_line(space: Space, tmp_path: Path) -> None:
    """Fails if a run takes parts of another mesh, or it is not said which file is missing or damaged."""
    folder = tmp_path / "parts"
    with pytest.raises(ParameterError, match=r"has no parts of a body \(FileNotFoundError at partition.json\): make"):
        Parted(folder).check(space, 2)
    write_parts(space, 2, folder)
    with pytest.raises(ParameterError, match="parts has 2 parts, and there is one rank: start it with mpiexec -n 2"):
        Parted(folder).check(space, 1)
    moved = Space(type(space.mesh)(space.mesh.p * (1 + 1e-9), space.mesh.t))
    with pytest.raises(ParameterError, match="parts has parts of another mesh than that of the scene: make them anew"):
        Parted(folder).check(moved, 2)
    (folder / "part_0001.npz").write_bytes(b"PK")
    with pytest.raises(ParameterError, match=r"part_0001.npz cannot be read"):
        Parted(folder).part(1)
    (folder / "part_0001.npz").unlink()
    with pytest.raises(ParameterError, match=r"parts lacks part_0001.npz: make the parts anew with skfsink partition"):
        Parted(folder).check(space, 2)


@ranks
@metis
def test_a_run_on_parts_in_a_folder(parted: tuple[Path, Path], tmp_path: Path) -> None:
    """Fails if parts that are read give another run than those that are cut, to the last bit."""
    deck, parts = parted
    for name, more in (("cut", []), ("read", ["--partition", parts])):
        finished(on(2, "-m", "skfsink", "run", deck, "--out", tmp_path / name, "--quiet", *more))
    assert (tmp_path / "read" / "history.csv").read_bytes() == (tmp_path / "cut" / "history.csv").read_bytes()
    assert (tmp_path / "read" / "history.csv").read_text().count("\n") > 2


@ranks
@metis
@pytest.mark.parametrize("count, said", [(1, "has 2 parts, and there is one rank: start it with mpiexec -n 2, or make "
                                             "others with skfsink partition -n 1"),
                                         (3, "has 2 parts, and there are 3 ranks: start it with mpiexec -n 2, or make "
                                             "others with skfsink partition -n 3")])
def test_parts_of_another_number_of_ranks(count: int, said: str, parted: tuple[Path, Path], tmp_path: Path) -> None:
    """Fails if ranks take up parts that are not theirs, or more than one of them says so."""
    command = on(count, "-m", "skfsink", "run", parted[0], "--out", tmp_path / "run", "--quiet", "--partition",
                 parted[1])
    assert finished(command if count > 1 else command[3:], 2) == f"skfsink: {parted[1]} {said}\n"
    assert not (tmp_path / "run").exists()


@ranks
@metis
def test_frames_in_pieces_are_those_of_one_file(parted: tuple[Path, Path], tmp_path: Path) -> None:
    """Fails if a piece is of another moment, or a field, a node or an element differs; or ParaView finds no pieces."""
    vtk = pytest.importorskip("vtk")
    from vtk.util.numpy_support import vtk_to_numpy
    for name, more in (("one", []), ("pieces", ["--frame-pieces"])):
        finished(on(2, "-m", "skfsink", "run", parted[0], "--out", tmp_path / name, "--quiet", *more))
    one, pieces = load(tmp_path / "one"), load(tmp_path / "pieces")
    assert len(one.frames) == len(pieces.frames) > 1 and np.array_equal(one.frames.times, pieces.frames.times)
    for before, after in zip(one.frames, pieces.frames):
        assert np.array_equal(before.points, after.points) and np.array_equal(before.cells[0].data, after.cells[0].data)
        assert before.point_data.keys() == after.point_data.keys() and before.cell_data.keys() == after.cell_data.keys()
        for name, values in before.point_data.items():
            np.testing.assert_array_equal(values, after.point_data[name], err_msg=name)
        for name, (values,) in before.cell_data.items():
            np.testing.assert_allclose(values, after.cell_data[name][0], rtol=1e-5, atol=1e-9, err_msg=name)
    index = tmp_path / "pieces" / "series" / "run_0001.pvtu"
    reader = vtk.vtkXMLPUnstructuredGridReader()
    reader.SetFileName(str(index))
    reader.Update()
    grid = reader.GetOutput()
    assert reader.GetNumberOfPieces() == 2 and grid.GetNumberOfCells() == len(one.frames[1].cells[0].data)
    for name, values in one.frames[1].point_data.items():
        node = vtk_to_numpy(grid.GetPointData().GetArray("node"))
        assert np.array_equal(vtk_to_numpy(grid.GetPointData().GetArray(name)), values[node])
    element = vtk_to_numpy(grid.GetCellData().GetArray("element"))
    assert np.array_equal(vtk_to_numpy(grid.GetCellData().GetArray("deleted")), one.frames[1].cell_data["deleted"][0][
        element])
    assert index.name in (index.parent / "run.pvd").read_text(encoding="utf-8")


LOOKER = """
import sys
import numpy as np
from skfsink import read_deck
from skfsink.fields.momentum import Momentum
from skfsink.fields.stress import cauchy_stress
from skfsink.run import Observer, run

class Looker(Observer):
    seen = 0
    def __init__(self):
        self.every = 1e-6
    def look(self, view):
        state, whole = view.state, view.body.momentum
        alone = Momentum(whole.space, whole.material)
        alone.set_gamma(state.gamma, state.deleted)
        force = alone.force(state.u)
        assert np.allclose(whole.W, alone.W, rtol=1e-12) and np.allclose(whole.gamma, alone.gamma, rtol=1e-12)
        assert np.allclose(view.stress, cauchy_stress(alone, state.u), rtol=1e-9)
        assert not view.crushed.any() and "pattern" not in vars(view.body.density)
        Looker.seen += 1
        assert np.allclose(whole.backend.mean_force(), alone.backend.mean_force(), rtol=1e-12)
        assert np.allclose(whole.force(state.u), force, atol=1e-12 * np.abs(force).max())

run(read_deck(sys.argv[1]).scene(), sys.argv[2], [Looker()], quiet=True)
print("seen", Looker.seen, file=sys.stderr)
"""


@ranks
@metis
def test_an_observer_sees_the_whole_body(parted: tuple[Path, Path], tmp_path: Path) -> None:
    """Fails if energy, density or stress of the whole body is of another moment, or it cannot be asked for a force."""
    script = tmp_path / "script.py"
    script.write_text(LOOKER, encoding="utf-8")
    said = finished(on(2, "-m", "skfsink.methods.ranks", script, parted[0], tmp_path / "run"))
    assert int(said.split("seen")[1]) > 3, said


@ranks
@metis
def test_a_part_that_one_rank_cannot_read(parted: tuple[Path, Path], tmp_path: Path) -> None:
    """Fails if the others go on waiting for a rank that has no part, or it is told more than once."""
    parts = tmp_path / "parts"
    shutil.copytree(parted[1], parts)
    with np.load(parts / "part_0001.npz") as file:
        kept = {name: file[name] for name in file if name != "cells"}
    np.savez(parts / "part_0001.npz", **kept)
    said = finished(on(2, "-m", "skfsink", "run", parted[0], "--out", tmp_path / "run", "--quiet", "--partition",
                       parts), 2)
    assert said.count("skfsink:") == 1 and "part_0001.npz cannot be read (KeyError): make the parts anew" in said


# --- all ranks ---
@ranks
@pytest.mark.parametrize("count", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_parts_add_up_to_the_whole_body(count: int) -> None:
    """Fails if a sum, a copy or a decision differs from that of the whole body on any rank; see `on_ranks.py`."""
    finished(on(count, HERE / "on_ranks.py"))


@ranks
@pytest.mark.parametrize("option, said", [
    ("--contact", "contact"), ("--kernels=forms", "kernels forms"), ("--sink=consistent", "the consistent sink")])
def test_what_several_ranks_do_not_know(option: str, said: str, mesh: Path, tmp_path: Path) -> None:
    """Fails if a body is loaded first, or an option is left out without a word."""
    text = finished(on(2, *case("--mesh", mesh, *SMALL, option, "--out", tmp_path / "run")), 2)
    assert text == f"skfsink: several ranks cannot compute {said}: start it on one rank\n"
    assert not (tmp_path / "run").exists()


@ranks
def test_one_line_and_not_one_a_rank(tmp_path: Path) -> None:
    """Fails if ranks all say what is wrong, or some of them go on waiting."""
    said = finished(on(3, *case("--mesh", tmp_path / "none.vtu", "--out", tmp_path / "run")), 2)
    assert said.count("skfsink:") == 1 and "none.vtu" in said


def test_ranks_without_mpi(tmp_path: Path) -> None:
    """Fails if a rank that cannot load MPI says nothing, all of them do, or each runs by itself."""
    (tmp_path / "mpi4py.py").write_text("raise ImportError('none here')\n")
    for rank, lines in ((0, 1), (1, 0)):
        done = subprocess.run(
            [sys.executable, *map(str, case("--out", tmp_path / "run"))], capture_output=True, text=True, check=False,
            env={**os.environ, "PMI_SIZE": "2", "PMI_RANK": str(rank),
                 "PYTHONPATH": os.pathsep.join([str(tmp_path), str(HERE.parent)])})
        assert done.returncode == 2 and done.stderr.count("\n") == lines, done.stderr
        assert lines == 0 or "2 ranks were started, and mpi4py cannot be loaded (none here): install" in done.stderr
    assert not (tmp_path / "run").exists()


@ranks
@pytest.mark.slow
def test_runs_on_several_ranks_are_those_on_one(mesh: Path, tmp_path: Path) -> None:
    """Fails if the number of ranks decides anything: the histories agree, and twice on two ranks to the last bit."""
    for name, count in (("one", 1), ("two", 2), ("again", 2), ("three", 3)):
        command = on(count, *case("--mesh", mesh, *ARGUMENTS, "--out", tmp_path / name))
        finished(command if count > 1 else command[3:])
    assert (tmp_path / "two" / "history.csv").read_bytes() == (tmp_path / "again" / "history.csv").read_bytes()
    one = _rows(tmp_path / "one")
    for name in ("two", "three"):
        _check_same(_rows(tmp_path / name), one)
        assert (tmp_path / name / "deletions.csv").read_text().count("\n") > 3


@ranks
@pytest.mark.slow
def test_loads_of_all_kinds_on_several_ranks(tmp_path: Path) -> None:
    """Fails if a load is not that of the whole body on any number of ranks, its ledger opens, or a run that was stopped
    on two ranks does not go on on three as it would have on one."""
    script = HERE / "loads_on_ranks.py"
    finished([sys.executable, str(script), str(tmp_path / "one")])
    for count, name, how in ((2, "two", []), (3, "three", []), (2, "stopped", ["stop"]), (3, "stopped", ["resume"])):
        finished(on(count, "-m", "skfsink.methods.ranks", script, tmp_path / name, *how))
    for kind in ("dead", "pressure", "filling", "oblique", "turn"):
        one = _rows(tmp_path / "one" / kind)
        assert int(one[-1]["deleted_elements"]) > 0
        for name in ("two", "three", "stopped"):
            rows = _rows(tmp_path / name / kind)
            _check_same(rows, one)
            balance = next(column for column in rows[0] if column.startswith("balance"))
            scale = max(float(row[f"elastic{balance[7:]}"]) for row in rows)
            assert max(abs(float(row[balance])) for row in rows if row["phase"] == "event") < 1e-9 * scale


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, float]:
    """Mesh and folder of a run on two ranks that nothing ends, and how long it takes [s]."""
    folder = tmp_path_factory.mktemp("whole")
    write_mesh(folder / "plate.vtu", plate())
    began = time.perf_counter()
    finished(on(2, *case("--mesh", folder / "plate.vtu", *ARGUMENTS, "--out", folder / "run")))
    return folder / "plate.vtu", folder / "run", time.perf_counter() - began


@ranks
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10), ids=lambda seed: f"lostagain{seed}" if seed else "once")
def test_a_lost_rank_ends_all_and_the_run_goes_on(seed: int, whole: tuple[Path, Path, float], tmp_path: Path) -> None:
    """Fails if a run waits for a rank that is lost at any moment, leaves a checkpoint that is torn, a lock or a
    process, or does not go on on another number of ranks to the same results."""
    mesh, expected, duration = whole
    run, choose = tmp_path / "run", random.Random(seed)
    moment, victim, count = choose.uniform(0.0, duration), choose.randrange(2), 1 + seed % 3
    began = time.perf_counter()
    with subprocess.Popen(on(2, *case("--mesh", mesh, *ARGUMENTS, "--out", run)), cwd=HERE.parent,
                          stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True) as program:
        while program.poll() is None and (time.perf_counter() - began < moment or len(_ranks_of(program.pid)) < 2):
            time.sleep(0.01)
        victims = sorted(_ranks_of(program.pid)) if program.poll() is None else []
        if victims:
            os.kill(victims[victim], signal.SIGKILL)
        program.communicate(timeout=60)
    time.sleep(0.2)
    assert not [pid for pid in victims if _lives(pid)]
    begun = (run / "checkpoint.npz").exists()  # or else it is started again
    again = case("--resume", run) if begun else case("--mesh", mesh, *ARGUMENTS, "--out", run, "--overwrite")
    finished(on(count, *again) if count > 1 else [sys.executable, *map(str, again)])
    _check_same(_rows(run), _rows(expected))
    assert _files(run) == _files(expected)


def _files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def _lives(pid: int) -> bool:
    """Whether there is such a process, and it is not one that only waits to be buried."""
    import psutil
    return bool(psutil.pid_exists(pid) and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE)


def _ranks_of(pid: int) -> list[int]:
    """Processes of Python below one of `mpiexec`."""
    import psutil
    return [child.pid for child in psutil.Process(pid).children(recursive=True) if "python" in child.name()]


def _rows(folder: Path) -> list[dict[str, str]]:
    with open(folder / "history.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _check_same(rows: list[dict[str, str]], expected: list[dict[str, str]]) -> None:
    """Same steps, energies and crack, up to what sums in another order do in a body that fails."""
    assert len(rows) == len(expected) > 20
    for name in expected[0]:
        if name == "phase" or name.startswith("balance"):
            assert name != "phase" or [row[name] for row in rows] == [row[name] for row in expected]
            continue
        one, other = (np.array([float(row[name] or "nan") for row in table]) for table in (rows, expected))
        scale = np.nanmax(np.abs(other), initial=0.0) or 1.0
        np.testing.assert_allclose(one / scale, other / scale, atol=1e-6, err_msg=name)


@ranks
def test_a_script_runs_on_the_first_rank(tmp_path: Path) -> None:
    """Fails if all ranks run a script, or one that ends with an error leaves the others waiting."""
    script = tmp_path / "script.py"
    script.write_text("import sys\nprint('once', sys.argv[1:], file=sys.stderr)\n")
    assert finished(on(2, "-m", "skfsink.methods.ranks", script, "a")).count("once ['a']") == 1
    script.write_text("raise ValueError('of the script')\n")
    assert "ValueError: of the script" in finished(on(2, "-m", "skfsink.methods.ranks", script), 1)


@ranks
@pytest.mark.slow
def test_an_end_of_time_leaves_a_checkpoint(mesh: Path, tmp_path: Path) -> None:
    """Fails if SIGTERM to `mpiexec` ends ranks before the first one has written, or is not told in one line."""
    run = tmp_path / "run"
    with subprocess.Popen(on(2, *case("--mesh", mesh, *ARGUMENTS[:-1], "1e6", "--out", run)),
                          cwd=HERE.parent, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as program:
        while not (run / "onset.npz").exists() and program.poll() is None:
            time.sleep(0.05)
        time.sleep(1.0)
        before = (run / "checkpoint.npz").stat().st_mtime_ns
        program.send_signal(signal.SIGTERM)
        _, said = program.communicate(timeout=60)
    assert (run / "checkpoint.npz").stat().st_mtime_ns > before
    assert said.count("interrupted; go on with skfsink resume") == 1, said
    finished(case_alone("--resume", run))
    assert (run / "summary.json").exists()
