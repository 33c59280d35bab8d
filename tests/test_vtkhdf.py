"""Frames in one VTKHDF file: the same numbers as in VTU files, for us and for VTK, and a run that goes on with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bodies import box
from guarded import NOTCHED, scene

import skfsink
from skfsink.errors import MissingExtra, OutputError
from skfsink.fem.space import Space
from skfsink.results.series import Series
from skfsink.results.stored_series import StoredSeries, pack_series
from skfsink.run.compute import run

h5py = pytest.importorskip("h5py", reason="h5py, of the extra view, is not installed")
TIMES = [0.0, 1e-6 / 3, 0.1 + 0.2]


def written(folder: Path, space: Space) -> Series:
    """Three frames of anything."""
    series, random = Series(folder, "run", space), np.random.default_rng(0)
    for time in TIMES:
        cells = {"deleted": random.uniform(size=space.n_elements) < 0.3,
                 "stress": random.normal(size=(space.n_elements, 6))}
        series.add(time, {"displacement": random.normal(size=space.X.shape),
                          "gamma": random.uniform(size=space.n_nodes)}, cells)
    series.flush()
    return series


def test_packed_frames_are_the_same(tmp_path: Path, kind: str) -> None:
    """Fails if a number, a node or a time changes, a frame is left behind, or packing again spoils the file."""
    written(tmp_path, box(kind, 3))
    before = StoredSeries.of(tmp_path, "run")
    meshes = [before.mesh(i) for i in range(3)]
    for _ in range(2):
        pack_series(tmp_path, "run")
        assert [path.name for path in tmp_path.iterdir()] == ["run.vtkhdf"]
    after = StoredSeries.of(tmp_path, "run")
    assert after.times == TIMES == list(before.times)
    for number, one in enumerate(meshes):
        two = after.mesh(number)
        np.testing.assert_array_equal(one.points, two.points)
        np.testing.assert_array_equal(one.cells[0].data, two.cells[0].data)
        assert one.cells[0].type == two.cells[0].type and one.point_data.keys() == two.point_data.keys()
        for name, values in one.point_data.items():
            np.testing.assert_array_equal(values, two.point_data[name])
        for name, (values,) in one.cell_data.items():
            np.testing.assert_array_equal(values, two.cell_data[name][0])


def test_vtk_steps_through_the_file(tmp_path: Path, kind: str) -> None:
    """Fails if VTK's own reader finds other times, cells or values."""
    vtk = pytest.importorskip("vtkmodules.vtkIOHDF", reason="vtk, of the extra view, is not installed")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

    space = box(kind, 3)
    written(tmp_path, space)
    expected = [StoredSeries.of(tmp_path, "run").mesh(i) for i in range(3)]
    pack_series(tmp_path, "run")
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(tmp_path / "run.vtkhdf"))
    reader.UpdateInformation()
    assert list(reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())) == TIMES
    for time, mesh in zip(TIMES[::-1], expected[::-1]):
        reader.UpdateTimeStep(time)
        grid = reader.GetOutput()
        np.testing.assert_array_equal(vtk_to_numpy(grid.GetPoints().GetData()), mesh.points)
        np.testing.assert_array_equal(vtk_to_numpy(grid.GetCells().GetConnectivityArray()), mesh.cells[0].data.ravel())
        np.testing.assert_array_equal(vtk_to_numpy(grid.GetPointData().GetArray("gamma")), mesh.point_data["gamma"])
        np.testing.assert_array_equal(vtk_to_numpy(grid.GetCellData().GetArray("stress")), mesh.cell_data["stress"][0])


def test_a_damaged_file_is_one_line(tmp_path: Path) -> None:
    """Fails if what is no such file, or half of one, is a traceback."""
    written(tmp_path, box("quad", 2))
    pack_series(tmp_path, "run")
    path = tmp_path / "run.vtkhdf"
    whole = path.read_bytes()
    for content in (b"", b"nothing", whole[:len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(OutputError, match=r"run\.vtkhdf is missing or damaged$"):
            StoredSeries.of(tmp_path, "run").mesh(0)
    with h5py.File(path, "w") as file:
        file.create_group("VTKHDF")
    with pytest.raises(OutputError, match=r"run\.vtkhdf is missing or damaged$"):
        StoredSeries.of(tmp_path, "run")


def test_a_run_leaves_one_file_that_is_loaded_and_resumed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a run with `series vtkhdf` has other frames, its end cannot be made again, or a later run finds them."""
    controls = {"event_time": 3e-6, "overshoot": 0.01, "checkpoint_every": 1e6, "frame_every": 1e-6}
    plain = run(scene(NOTCHED.sample, **controls), tmp_path / "vtu", quiet=True)
    one = scene(NOTCHED.sample, series="vtkhdf", **controls)
    packed = run(one, tmp_path / "one", quiet=True)
    frames = [StoredSeries.of(tmp_path / name / "series", "run") for name in ("vtu", "one")]
    assert [*frames[0].times] == [*frames[1].times] and plain.summary["moments"] == packed.summary["moments"]
    for number in range(len(frames[0])):
        for name, values in frames[0].mesh(number).point_data.items():
            np.testing.assert_array_equal(values, frames[1].mesh(number).point_data[name])
    assert (tmp_path / "vtu" / "history.csv").read_bytes() == (tmp_path / "one" / "history.csv").read_bytes()
    assert not list((tmp_path / "one" / "series").glob("*.vtu"))
    (tmp_path / "one" / "summary.json").unlink()
    again = run(one, tmp_path / "one", quiet=True, resume=True)  # the end of the run once more
    assert again.summary["moments"] == packed.summary["moments"]
    run(scene(NOTCHED.sample, **controls), tmp_path / "one", quiet=True, overwrite=True)
    assert not list((tmp_path / "one" / "series").glob("*.vtkhdf"))
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(MissingExtra, match=r"--series vtkhdf needs h5py: pip install"):
        run(one, tmp_path / "other", quiet=True)
    assert not (tmp_path / "other").exists() and skfsink.load(tmp_path / "vtu").frames.times.size
