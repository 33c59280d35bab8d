"""The files of a run: bits survive the round trip, a killed run leaves readable files, bad folders are refused."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

import meshio
import numpy as np
import pytest
from bodies import grid

from skfsink.errors import OutputError
from skfsink.fem.space import Space
from skfsink.results.history import HISTORY_COLUMNS, Column, History, history_header, load_name, onset_load
from skfsink.results.series import Series
from skfsink.results.summary import versions, write_summary
from skfsink.system.files import prepare_folder, replaced, write_atomic

AWKWARD = [0.1 + 0.2, 1 / 3, -0.0, 5e-324, 1.7976931348623157e308, math.nan, -math.inf, np.float64(np.pi)]


def rows(number: int = len(AWKWARD)) -> list[dict]:
    """Rows of a made-up run, with floats that only an exact format brings back."""
    values = [name for name in HISTORY_COLUMNS if name not in {"phase", "step", "tips", "branches", "deleted_elements"}]
    return [{"phase": "loading" if i < 2 else "event", "step": np.int64(i), "tips": 1, "branches": 2,
             "deleted_elements": 3 * i, **{name: AWKWARD[(i + j) % len(AWKWARD)] for j, name in enumerate(values)}}
            for i in range(number)]


def same_bits(one: dict[str, np.ndarray], two: dict[str, np.ndarray]) -> bool:
    """Whether two histories agree to the bit, NaN and the sign of zero included."""
    return list(one) == list(two) and all(
        one[name].dtype == two[name].dtype and one[name].tobytes() == two[name].tobytes() for name in one)


# --- history ---
def test_history_comes_back_to_the_bit(tmp_path: Path) -> None:
    history = History(tmp_path / "history.csv")
    for row in rows():
        history.append(row)
    loaded = History.load(history.path)
    assert list(loaded) == list(HISTORY_COLUMNS)
    assert same_bits(loaded, history.columns())
    assert loaded["phase"].tolist() == ["loading"] * 2 + ["event"] * 6
    assert loaded["deleted_elements"].dtype == np.int64
    expected = np.array([row["elastic"] for row in rows()])
    assert loaded["elastic"].tobytes() == expected.tobytes()


def test_history_goes_on_from_a_checkpoint_as_if_never_stopped(tmp_path: Path) -> None:
    whole = History(tmp_path / "whole.csv", rows())
    first = History(tmp_path / "parts.csv")
    for row in rows(6):
        first.append(row)
    second = History(tmp_path / "parts.csv", first.rows[:4])  # the checkpoint was older than the last row
    for row in rows()[4:]:
        second.append(row)
    assert second.path.read_bytes() == whole.path.read_bytes()


def test_history_of_a_killed_run_is_read_up_to_its_last_whole_row(tmp_path: Path) -> None:
    history = History(tmp_path / "history.csv", rows())
    text = history.path.read_text()
    start = text.rindex("\n", 0, -1) + 1  # of the last row
    for end in range(start, len(text)):
        history.path.write_text(text[:end])
        assert len(History.load(history.path)["step"]) == len(AWKWARD) - 1
    assert len(History.load(History(tmp_path / "empty.csv").path)["step"]) == 0


def test_columns_left_out_and_columns_unknown(tmp_path: Path) -> None:
    history = History(tmp_path / "history.csv")
    history.append({"phase": "event", "elastic": 1})
    loaded = History.load(history.path)
    assert loaded["elastic"] == 1.0 and np.isnan(loaded["tip_x_mm"][0]) and loaded["tips"] == 0
    with pytest.raises(KeyError, match="no column tip_w_mm"):
        history.append({"tip_w_mm": 1.0})


@pytest.mark.parametrize("dim, force, energy", [(2, "N_per_mm", "N_mm_per_mm"), (3, "N", "N_mm")])
def test_each_column_says_its_unit_and_old_files_are_read(tmp_path: Path, dim: int, force: str, energy: str) -> None:
    """Fails if a quantity with a unit has none in the header, or a file of version 0.1 is not read as before."""
    made = [{**row, "tip_z_mm": 0.1 if dim == 3 else math.nan} for row in rows()]
    history = History(tmp_path / "history.csv", made, dim)
    header = history.path.read_text().splitlines()[0].split(",")
    plain = {"phase", "step", "tips", "branches", "deleted_elements", "gamma_min"}
    units = ("_s", "_mm", "_MPa", f"_mm{dim}", force, energy)
    assert [name for name in header if not name.endswith(units) and name not in plain] == []
    loaded = History.load(history.path)
    assert load_name(dim) == f"reaction_{force}" in history_header(dim)
    assert onset_load({load_name(dim): 2.0}) == onset_load({"reaction_N_per_mm": 2.0}) == 2.0
    assert loaded.dim == dim and loaded[f"reaction_{force}"] is loaded["reaction_N_per_mm"]
    assert {name.replace(" ", "_").replace("/", "_per_") for name in loaded.units.values()} == {
        "", "1", "s", "mm", "m_per_s", "MPa", "N_per_mm", f"mm^{dim}", force, energy}
    with pytest.raises(KeyError):
        loaded["nothing"]
    old = history.path.read_text().replace(",".join(header), ",".join(HISTORY_COLUMNS), 1)
    history.path.write_text(old)
    assert same_bits(History.load(history.path), loaded) and History.load(history.path).units == loaded.units


def test_column_that_a_run_has_not(tmp_path: Path) -> None:
    """Fails if a column that a run does not have is in its file, or is missing where the file is read.

    Seen to fail with `without` left unused.
    """
    whole = History(tmp_path / "whole.csv", rows())
    history = History(tmp_path / "history.csv", rows()[:1], without=["contact"])
    for row in rows()[1:]:
        history.append(row)
    header, *lines = (line.split(",") for line in history.path.read_text().splitlines())
    place = history_header(2).index("contact_N_mm_per_mm")
    assert header == [name for i, name in enumerate(history_header(2)) if i != place]
    assert lines == [[cell for i, cell in enumerate(line.split(",")) if i != place]
                     for line in whole.path.read_text().splitlines()[1:]]
    assert (History.load(history.path)["contact"] == 0.0).all()


def test_columns_of_other_versions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a column of your own makes runs without it unreadable, or a run with it elsewhere."""
    history = History(tmp_path / "history.csv", rows())
    monkeypatch.setitem(HISTORY_COLUMNS, "speed_m_per_s", Column("speed of a node", "m/s", before=math.nan))
    assert np.isnan(History.load(history.path)["speed_m_per_s"]).all()  # that has the column `loads`
    text = [line.split(",") for line in history.path.read_text().splitlines()]
    place = text[0].index("loads_N_mm_per_mm")
    (tmp_path / "oldest.csv").write_text("".join(",".join(line[:place] + line[place + 1:]) + "\n" for line in text))
    assert (History.load(tmp_path / "oldest.csv")["loads"] == 0.0).all()
    monkeypatch.setitem(HISTORY_COLUMNS, "word", Column("a word", "", str))
    with pytest.raises(OutputError, match="it has no column word"):
        History.load(history.path)
    new = History(tmp_path / "new.csv", [{**row, "speed_m_per_s": 2.0, "word": "a"} for row in rows()])
    for name in ("speed_m_per_s", "word"):
        monkeypatch.delitem(HISTORY_COLUMNS, name)
    table = History.load(new.path)
    assert (table["speed_m_per_s"] == 2.0).all() and set(table["word"]) == {"a"} and table.units["word"] == ""
    assert same_bits({name: table[name] for name in HISTORY_COLUMNS}, History.load(history.path))


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", ",".join(HISTORY_COLUMNS) + "\nevent,1\n",
                                  ",".join(HISTORY_COLUMNS) + "\n" + ",".join(["x"] * len(HISTORY_COLUMNS)) + "\n",
                                  ",".join(history_header(3)) + "\nevent,1\n"])
def test_other_files_are_no_history(tmp_path: Path, text: str) -> None:
    path = tmp_path / "history.csv"
    path.write_text(text)
    with pytest.raises(OutputError) as error:
        History.load(path)
    assert str(error.value) == f"{path} is not a history file of skfsink, or is damaged"


def test_missing_history(tmp_path: Path) -> None:
    with pytest.raises(OutputError) as error:
        History.load(tmp_path / "history.csv")
    assert str(error.value) == f"cannot read the history {tmp_path / 'history.csv'}: No such file or directory"


# --- atomic writing ---
def test_a_file_is_replaced_as_a_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "file"
    write_atomic(path, "old\n")
    with pytest.raises(RuntimeError), replaced(path) as part:
        part.write_text("half of the n")
        raise RuntimeError
    assert path.read_bytes() == b"old\n"
    write_atomic(path, b"\x00new")
    assert path.read_bytes() == b"\x00new"
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_writing_where_no_folder_is(tmp_path: Path) -> None:
    path = tmp_path / "no" / "file"
    with pytest.raises(OutputError) as error:
        write_atomic(path, "")
    assert str(error.value) == f"cannot write {path}: No such file or directory"


# --- series ---
def sheared(kind: str, mirrored: bool) -> Space:
    """Skew elements with plane faces, numbered in one sense or in the other."""
    mesh = grid(kind, (3, 2) if kind == "quad" else (3, 2, 2))
    skew = np.array([[1.0, 0.3, 0.1], [0.2, 0.8, 0.0], [0.1, 0.2, 0.5]])[:len(mesh.p), :len(mesh.p)]
    if mirrored:
        skew[0] *= -1
    return Space(type(mesh)(skew @ mesh.p, mesh.t))


def fields(space: Space, seed: int) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    random = np.random.default_rng(seed)
    return ({"displacement": random.normal(size=space.X.shape), "gamma": random.uniform(size=space.n_nodes)},
            {"deleted": random.uniform(size=space.n_elements) < 0.3, "W": random.uniform(size=space.n_elements)})


def named(series: Series) -> list[Path]:
    """The files a PVD file names."""
    return [series.folder / entry.attrib["file"] for entry in ET.parse(series.path).iter("DataSet")]


@pytest.mark.parametrize("mirrored", [False, True])
def test_cells_have_their_volume_and_fields_their_values(tmp_path: Path, kind: str, mirrored: bool) -> None:
    space = sheared(kind, mirrored)
    series = Series(tmp_path, "run", space)
    points, cells = fields(space, 0)
    series.add(0.0, points, cells | {"huge": np.full(space.n_elements, 1e60)})
    series.flush()
    mesh = meshio.read(series.frame(0))
    assert [block.type for block in mesh.cells] == ["quad" if kind == "quad" else "hexahedron"]
    corners = mesh.points[mesh.cells[0].data]
    edges = corners[:, [1, 3, 4] if kind == "hex" else [1, 3]] - corners[:, :1]
    np.testing.assert_allclose(np.linalg.det(edges[:, :, :space.dim]), space.V, rtol=1e-12)  # of a parallelepiped
    opposite = corners[:, 0] + edges.sum(axis=1)
    np.testing.assert_allclose(corners[:, 6 if kind == "hex" else 2], opposite, atol=1e-12)
    np.testing.assert_array_equal(mesh.points[:, :space.dim], space.X)
    u = mesh.point_data["displacement"]
    np.testing.assert_array_equal(u[:, :space.dim], points["displacement"].astype(np.float32))
    assert u.shape[1] == 3 and not u[:, space.dim:].any()
    np.testing.assert_array_equal(mesh.cell_data["deleted"][0], cells["deleted"])
    assert np.isfinite(mesh.cell_data["huge"][0]).all()


def test_paraview_s_library_opens_the_series(tmp_path: Path, kind: str) -> None:
    pyvista = pytest.importorskip("pyvista")
    space = sheared(kind, mirrored=False)
    series = Series(tmp_path, "run", space)
    times = [0.0, 1e-6 / 3, 0.1 + 0.2]
    for i, time in enumerate(times):
        series.add(time, *fields(space, i))
    series.flush()
    reader = pyvista.get_reader(series.path)
    assert list(reader.time_values) == times
    reader.set_active_time_point(2)
    data = reader.read()[0]
    sizes = data.compute_cell_sizes()["Volume" if kind == "hex" else "Area"]
    np.testing.assert_allclose(sizes, space.V, rtol=1e-6)
    np.testing.assert_array_equal(data["gamma"], fields(space, 2)[0]["gamma"].astype(np.float32))


def test_a_frame_that_cannot_be_written_is_reported_and_later_changes_do_not_reach_it(tmp_path: Path) -> None:
    """Fails if the error of the thread that writes is lost, or if it is given the caller's arrays instead of copies."""
    space = sheared("quad", mirrored=False)
    (tmp_path / "series").mkdir()
    series = Series(tmp_path / "series", "run", space)
    gamma, flags = np.ones(space.n_nodes), np.zeros(space.n_elements, np.int8)
    series.add(0.0, {"gamma": gamma}, {"deleted": flags})
    gamma[:], flags[:] = 0.0, 1
    series.flush()
    mesh = meshio.read(series.frame(0))
    assert (mesh.point_data["gamma"] == 1).all() and not mesh.cell_data["deleted"][0].any()
    shutil.rmtree(tmp_path / "series")
    series.add(1.0, {"gamma": gamma}, {})
    with pytest.raises(OutputError):
        series.flush()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills a fork of this process")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("after", [False, True])
@pytest.mark.parametrize("call", range(1, 7))
def test_killed_midway_the_series_names_no_missing_file_and_goes_on(tmp_path: Path, call: int, after: bool) -> None:
    space = sheared("quad", mirrored=False)
    whole = Series(tmp_path, "whole", space)
    for i in range(4):
        whole.add(0.1 * i, *fields(space, i))
    whole.flush()
    child = os.fork()
    if child == 0:  # dies just before or just after a file is put in its place: frame, index, frame, ...
        replace, count = os.replace, iter(range(1, 10))

        def deadly(source: Path, target: Path) -> None:
            last = next(count) == call
            if not last or after:
                replace(source, target)
            if last:
                os.kill(os.getpid(), signal.SIGKILL)

        os.replace = deadly
        series = Series(tmp_path, "run", space)
        for i in range(4):
            series.add(0.1 * i, *fields(space, i))
        os._exit(1)
    assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL
    series = Series(tmp_path, "run", space)
    frames = named(series) if series.path.exists() else []
    assert len(frames) == (call - (not after)) // 2
    for path in frames:
        assert len(meshio.read(path).points) == space.n_nodes
    series.resume(len(frames))
    for i in range(len(frames), 4):
        series.add(0.1 * i, *fields(space, i))
    series.flush()
    assert [p.read_bytes() for p in named(series)] == [p.read_bytes() for p in named(whole)]


def test_resuming_drops_later_frames_and_only_those(tmp_path: Path) -> None:
    space = sheared("quad", mirrored=False)
    series = Series(tmp_path, "run", space)
    for i in range(5):
        series.add(i, *fields(space, i))
    series.flush()
    foreign = tmp_path / "running_0004.vtu"
    foreign.write_text("")
    again = Series(tmp_path, "run", space)
    again.resume(2)
    assert again.times == [0.0, 1.0]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.pvd", "run_0000.vtu", "run_0001.vtu", foreign.name]
    assert named(again) == [again.frame(0), again.frame(1)]
    with pytest.raises(OutputError) as error:
        again.resume(3)
    assert str(error.value) == f"cannot resume the series of fields: {again.path} has 2 of the 3 frames"
    again.frame(0).unlink()
    with pytest.raises(OutputError, match="has 1 of the 2 frames"):
        again.resume(2)
    with pytest.raises(OutputError, match=r"no\.pvd is missing or damaged"):
        Series(tmp_path, "no", space).resume(1)


# --- folders ---
def test_a_new_or_empty_folder_is_taken(tmp_path: Path) -> None:
    for _ in range(2):
        assert prepare_folder(tmp_path / "a" / "b") == tmp_path / "a" / "b"
        assert list((tmp_path / "a" / "b").iterdir()) == []


def test_a_folder_with_something_in_it_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(OutputError) as error:
        prepare_folder(tmp_path)
    assert str(error.value) == (f"the output folder {tmp_path} is not empty; name another one, or allow to "
                                "overwrite it")
    prepare_folder(tmp_path, overwrite=True)
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("thesis.tex", "years of work")]


def test_a_folder_that_cannot_be_used_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(OutputError) as error:
        prepare_folder(file)
    assert str(error.value) == f"the output folder {file} is a file"
    with pytest.raises(OutputError) as error:
        prepare_folder(file / "below")
    assert str(error.value) == f"cannot write to the output folder {file / 'below'}: Not a directory"

    def refuse(**_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    with pytest.raises(OutputError) as error:
        prepare_folder(tmp_path / "new")
    assert str(error.value) == f"cannot write to the output folder {tmp_path / 'new'}: Permission denied"


# --- summary ---
def test_summary_keeps_order_and_values(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    summary = {"z": np.float64(0.1), "a": {"n": np.int64(3), "list": (1, 2.5), "array": np.eye(2), "yes": np.True_},
               "none": None, "γ": "µs", "file": Path("run") / "x"}
    write_summary(path, summary)
    text = path.read_text(encoding="utf-8")
    assert text.endswith("}\n") and '\n "a": {\n  "n": 3,' in text and "γ" in text
    read = json.loads(text)
    assert list(read) == list(summary)
    assert read["z"] == 0.1 and read["a"] == {"n": 3, "list": [1, 2.5], "array": [[1, 0], [0, 1]], "yes": True}


@pytest.mark.parametrize("bad, name", [({"a": {"U": math.nan}}, "summary.a.U is nan"),
                                       ({"x": [0.0, np.array([1.0, -np.inf])]}, "summary.x[1][1] is -inf")])
def test_numbers_that_are_not_finite_are_refused_by_name(tmp_path: Path, bad: dict, name: str) -> None:
    path = tmp_path / "summary.json"
    write_summary(path, {"good": 1})
    with pytest.raises(OutputError) as error:
        write_summary(path, bad)
    assert str(error.value) == f"{name}: a summary holds finite numbers only"
    assert json.loads(path.read_text()) == {"good": 1}


def test_versions() -> None:
    found = versions()
    assert list(found)[:2] == ["skfsink", "python"] and list(found)[-1] == "machine"
    assert {"numpy", "scipy", "scikit-fem", "numba", "pyamg", "meshio"} <= set(found)
    assert found["numpy"] == np.__version__
