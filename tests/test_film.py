"""Pictures of bodies in space from the files of a run, still and moving."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from references import STEP, TIPS, scene_of, write_run

import skfsink
from skfsink.cli.program import command
from skfsink.cli.render import render
from skfsink.errors import OutputError, ParameterError
from skfsink.pictures.body import body
from skfsink.pictures.film import camera_of, film, still
from skfsink.pictures.render import bounds
from skfsink.results.frame import read_frame
from skfsink.results.series import Series

pytest.importorskip("pyvista", reason="pyvista, the extra view, is not installed")


@pytest.fixture(scope="module")
def shell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A made-up run of the shell."""
    return write_run(tmp_path_factory.mktemp("film") / "shell", scene_of("cylindrical_shell"))


def test_the_camera_sees_what_the_other_pictures_show(shell: Path) -> None:
    """Fails if azimuth or elevation mean something else than in `density.png`."""
    scene = skfsink.load(shell).scene
    frame, space = read_frame(shell / "series" / "run_0000.vtu", 0.0, "", 3), scene.sample.space
    seen = bounds(space, [frame], camera_of(scene.view), margin=0.0)
    np.testing.assert_allclose(body(space, frame, scene.view).box, seen, atol=1e-6)



def test_a_film_has_every_frame_and_moves(shell: Path, tmp_path: Path) -> None:
    """Fails if a frame is left out, or the crack does not open more and more of the shell."""
    film(skfsink.load(shell), tmp_path / "film.gif", width=240, seconds=2.0)
    with Image.open(tmp_path / "film.gif") as gif:
        assert gif.n_frames == len(TIPS) and gif.width == 240
        dark = []
        for i in range(gif.n_frames):
            gif.seek(i)
            picture = np.asarray(gif.convert("RGB"), float)[:, :190]  # beside the bar
            dark.append(int(((picture.max(axis=2) - picture.min(axis=2)) > 60).sum()))
    assert dark == sorted(dark) and dark[-1] > 2 * dark[0]


def test_a_still_by_the_command(shell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails if the picture is not where it is said to be, or not of the moment and field asked for."""
    for field in ("gamma", "speed"):
        with pytest.raises(SystemExit) as end:
            command(render, [str(shell), "--moment", "arrival", "--field", field, "--width", "300", "--azimuth", "90"],
                    package="commands")
        assert end.value.code == 0 and capsys.readouterr().out == f"{shell / f'{field}-arrival.png'}\n"
    pictures = [np.asarray(Image.open(shell / f"{field}-arrival.png").convert("RGB")) for field in ("gamma", "speed")]
    assert pictures[0].shape == pictures[1].shape and pictures[0].shape[1] == 300
    assert np.abs(pictures[0].astype(float) - pictures[1]).mean() > 10
    still(skfsink.load(shell), tmp_path / "other.jpg", 3, width=300, view=(90.0, 25.0))
    with Image.open(tmp_path / "other.jpg") as picture:
        assert picture.format == "JPEG"
        assert np.abs(np.asarray(picture, float) - pictures[0]).mean() < 3  # arrival is frame 3
    assert skfsink.load(shell).frames.times[3] == 3 * STEP


def test_a_field_of_elements_is_rendered(tmp_path: Path) -> None:
    """Fails if a body in space is not in the colours of the field: half of it at 0, half at the greatest value."""
    folder = write_run(tmp_path / "shell", scene_of("cylindrical_shell"))
    run = skfsink.load(folder)
    space = run.scene.space
    right = space.X[space.conn].mean(axis=1)[:, 0] > 0
    Series(folder / "series", "run", space).resume(0)
    series = Series(folder / "series", "run", space)
    series.add(0.0, {"displacement": 0 * space.X, "velocity": 0 * space.X, "gamma": np.ones(space.n_nodes)},
               {"deleted": np.zeros(space.n_elements, np.int8), "von_mises": right.astype(float)})
    series.flush()
    still(skfsink.load(folder), tmp_path / "a.png", 0, "von_mises", width=400)
    picture = np.asarray(Image.open(tmp_path / "a.png").convert("RGB"), float)[:, :320].reshape(-1, 3)
    yellow = (picture[:, 0] > 1.5 * picture[:, 2]) & (picture[:, 1] > 1.5 * picture[:, 2])
    purple = (picture[:, 2] > 1.3 * picture[:, 1]) & (picture[:, 0] < 120)
    assert min(yellow.sum(), purple.sum()) > 0.3 * max(yellow.sum(), purple.sum()) > 1000


def test_refusals(shell: Path, tmp_path: Path) -> None:
    """Fails if what cannot be shown is not one line that says what can."""
    run = skfsink.load(shell)
    with pytest.raises(ParameterError, match=r"^field must be one of gamma, speed, von_mises, .*; got 'stress'$"):
        still(run, tmp_path / "a.png", field="stress")
    with pytest.raises(OutputError, match=r"has no frame 9; it has onset, branching, arrival, end, or 0 to 5$"):
        still(run, tmp_path / "a.png", 9)
    assert not list(tmp_path.glob("a.*"))
