"""Fields as they are drawn and filmed: values and colours, the load over displacement, titles, unfinished runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bodies import grid
from guarded import NOTCHED, Stop, scene
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from references import STEP, TIPS, scene_of, write_run

import skfsink
from skfsink.errors import Interrupted, OutputError, ParameterError
from skfsink.fem.space import Space
from skfsink.fields.frame_fields import ON_REQUEST, asked_fields
from skfsink.fields.momentum import Momentum
from skfsink.material import NeoHookean
from skfsink.pictures import plot
from skfsink.pictures.film import film, still
from skfsink.pictures.looks import nodal, scale_of
from skfsink.results.frame import Frame
from skfsink.results.history import History, Table
from skfsink.results.loading import way_to_onset
from skfsink.run.compute import run


@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A made-up run of the plate with an edge notch."""
    return write_run(tmp_path_factory.mktemp("looks") / "plate", scene_of("single_edge_notch"))


def frame(space: Space, values: np.ndarray, field: str = "von_mises", dead: int | None = None) -> Frame:
    deleted = np.zeros(space.n_elements, bool)
    if dead is not None:
        deleted[dead] = True
    return Frame(0.0, "", np.zeros_like(space.X), np.ones(space.n_nodes), deleted, None, {field: values})


# --- values and colours ---
def test_fields_of_elements_are_averaged_at_nodes() -> None:
    """Fails if a value that is the same everywhere changes, one of a failed or crushed element counts, or volumes do
    not weigh."""
    space = Space(grid("quad", (4, 4)))
    values = np.full(space.n_elements, 3.0)
    values[5], values[6] = np.nan, 1e9
    np.testing.assert_allclose(nodal(space, frame(space, values, dead=6), "von_mises"), 3.0, rtol=1e-12)
    rising = space.X[space.conn].mean(axis=1)[:, 0]
    inner = np.flatnonzero((space.X > 1e-9).all(axis=1) & (space.X.max(axis=0) - 1e-9 > space.X).all(axis=1))
    np.testing.assert_allclose(nodal(space, frame(space, rising), "von_mises")[inner], space.X[inner, 0], atol=1e-12)


def test_a_few_extreme_values_do_not_take_all_colours() -> None:
    """Fails if one element sets the range, if signs are lost, or a stretch does not begin at 1."""
    space = Space(grid("quad", (20, 20)))
    values = np.full(space.n_elements, 0.9)
    values[7] = 1e6
    for field, expected in (("von_mises", (0.0, 1.0)), ("stretch", (1.0, 2.0)), ("pressure", (0.0, 1.0))):
        one = frame(space, values + (field == "stretch"), field)
        assert scale_of(space, [one], [nodal(space, one, field)], field).limits == pytest.approx(expected)
    values[:200] = -0.4
    one = frame(space, values, "pressure")
    scale = scale_of(space, [one], [nodal(space, one, "pressure")], "pressure")
    assert scale.limits == pytest.approx((-1.0, 1.0)) and scale.extend == "both"


def test_stretch_and_stress_of_a_homogeneous_deformation() -> None:
    """Fails if the greatest principal values are others than those of the deformation gradient."""
    space = Space(grid("quad", (3, 3)))
    momentum = Momentum(space, NeoHookean(density=1000.0))
    F = np.array([[1.3, 0.4], [0.0, 1 / 1.3]])
    u = space.X @ (F - np.eye(2)).T
    stress = np.tile([1.0, -2.0, 0.5, 2.0, 0.0, 0.0], (space.n_elements, 1))
    np.testing.assert_allclose(ON_REQUEST["stretch"](momentum, u, stress), np.linalg.norm(F, 2), rtol=1e-12)
    np.testing.assert_allclose(ON_REQUEST["principal_stress"](momentum, u, stress), 2.0, rtol=1e-12)


@pytest.mark.parametrize(("text", "said"), [("stress", "got 'stress'"), ("W, W", "W twice"), ("W,", "got ''")])
def test_fields_that_there_are_not(text: str, said: str) -> None:
    """Fails if a field that cannot be drawn is found out only at the end of a run."""
    assert asked_fields(" W, stretch ") == ("W", "stretch") and asked_fields("") == ()
    with pytest.raises(ParameterError, match=said):
        scene(NOTCHED.sample, fields=text)


# --- load over displacement ---
def written(folder: Path, loading: int, load: float) -> Path:
    """The history of a run that was loaded in some increments, and two rows of its event."""
    folder.mkdir(parents=True)
    history = History(folder / "history.csv")
    for i in range(loading):
        at = 0.1 * (i + 1 if loading > 1 else 3)
        history.append({"phase": "loading", "step": i + 1, "grip_displacement_mm": at, "reaction_N_per_mm": load * at,
                        "gamma_min": 0.98})
    for i in range(2):
        history.append({"phase": "event", "step": i, "grip_displacement_mm": 0.31, "reaction_N_per_mm": 0.5})
    return folder


def test_both_parts_of_an_analysis_are_loaded_from_the_origin(tmp_path: Path) -> None:
    """Fails if the quasi-static part, which begins at the onset of the dynamic one, has no way to it, or another's."""
    written(tmp_path / "dynamic", 3, 2.0)
    part = written(tmp_path / "quasistatic", 1, 2.0)
    assert way_to_onset(part)["grip_displacement_mm"].tolist() == pytest.approx([0.1, 0.2, 0.3])
    alone = written(tmp_path / "other" / "quasistatic", 1, 2.0)
    assert len(way_to_onset(alone)["step"]) == 1
    written(tmp_path / "other" / "dynamic", 2, 2.0)  # another loading: it ends elsewhere
    assert len(way_to_onset(alone)["step"]) == 1


def test_the_load_begins_at_the_origin_and_marks_the_onset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the curve does not begin unloaded, or the onset is not its end."""
    kept: list[Figure] = []
    monkeypatch.setattr(plot, "Figure", lambda *a, **k: kept.append(Figure(*a, **k)) or kept[-1])
    folder = written(tmp_path / "run", 3, 2.0)
    history = History.load(folder / "history.csv")
    event = Table({name: values[3:] for name, values in history.items()}, 2)
    plot.loading_picture(way_to_onset(folder), tmp_path / "loading.svg", "Load", event)
    ax = kept[0].axes[0]
    lines = {line.get_label().partition(":")[0]: line.get_xydata() for line in ax.lines}
    assert lines["loading"][0].tolist() == [0, 0] and lines["onset"].tolist() == [lines["loading"][-1].tolist()]
    assert lines["onset"][0] == pytest.approx([0.3, 0.6]) and len(lines["event"]) == 2
    assert (ax.get_xlim()[0], ax.get_ylim()[0]) == (0.0, 0.0)
    first = (tmp_path / "loading.svg").read_bytes()
    plot.loading_picture(way_to_onset(folder), tmp_path / "loading.svg", "Load", event)
    assert (tmp_path / "loading.svg").read_bytes() == first and b"<svg" in first  # equal runs leave equal files


@pytest.mark.parametrize("title", ["A plate with a very long title of its own, mesh fine, dynamic, explicit integrator",
                                   "AVeryLongTitle" * 20])
def test_titles_fit(title: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a title reaches beyond its picture."""
    figure = Figure((3, 2), layout="constrained")
    figure.subplots()
    plot.save(figure, tmp_path / "a.png", title)
    box = figure._suptitle.get_window_extent(FigureCanvasAgg(figure).get_renderer())
    assert figure.get_suptitle().replace("\n", " ") == title
    assert box.x0 >= 0 and box.x1 <= figure.bbox.width


# --- films and stills of plane bodies ---
def test_a_film_of_a_plane_body(plate: Path, tmp_path: Path) -> None:
    """Fails if a frame is left out, the pictures differ in size, or the crack does not move."""
    film(skfsink.load(plate), tmp_path / "film.gif", "speed", width=240, seconds=2.0)
    with Image.open(tmp_path / "film.gif") as gif:
        assert gif.n_frames == len(TIPS) and abs(gif.width - 240) <= 1
        first = np.asarray(gif.convert("RGB"), float)
        gif.seek(3)
        assert np.abs(np.asarray(gif.convert("RGB"), float) - first).mean() > 1


def test_a_film_as_mp4(plate: Path, tmp_path: Path) -> None:
    """Fails if the file is no film of that size and about that long."""
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="imageio-ffmpeg, of the extra view, is not installed")
    film(skfsink.load(plate), tmp_path / "film.mp4", width=240, seconds=2.0)
    frames = ffmpeg.read_frames(tmp_path / "film.mp4")
    about = next(frames)
    assert about["size"][0] == 240 and about["codec"] == "h264" and about["duration"] == pytest.approx(2.0, rel=0.1)
    pictures = [np.frombuffer(picture, np.uint8).astype(float) for picture in frames]
    assert len(pictures) == len(TIPS) + 5 and np.abs(pictures[-1] - pictures[0]).mean() > 1


def test_stills_and_refusals(plate: Path, tmp_path: Path) -> None:
    """Fails if a picture is not in the format of its name, or what cannot be drawn is not one line that says why."""
    loaded = skfsink.load(plate)
    still(loaded, tmp_path / "a.png", "arrival", width=300)
    still(loaded, tmp_path / "a.pdf", "arrival")
    with Image.open(tmp_path / "a.png") as picture:
        assert abs(picture.width - 300) <= 1
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF") and loaded.frames.times[3] == 3 * STEP
    with pytest.raises(OutputError, match=r"^the frames have no field stretch: run the scene with --fields stretch$"):
        still(loaded, tmp_path / "b.png", field="stretch")
    with pytest.raises(OutputError, match=r"a film is a file ending in .gif or .mp4; got .*b\.avi"):
        film(loaded, tmp_path / "b.avi")
    with pytest.raises(ParameterError, match="phase must be one of event, loading, all; got 'end'"):
        film(loaded, tmp_path / "b.gif", phase="end")
    assert not list(tmp_path.glob("b.*"))


# --- runs that are not finished ---
@pytest.mark.usefixtures("pictures")
def test_an_interrupted_run_draws_what_it_has(tmp_path: Path) -> None:
    """Fails if a run that has stopped leaves no pictures, or claims to have ended."""
    asked = scene(NOTCHED.sample, event_time=8e-6, overshoot=0.01, checkpoint_every=1e6, frame_every=1e-6,
                  fields="W", pictures="svg")
    with pytest.raises(Interrupted):
        run(asked, tmp_path / "run", [Stop(60)], quiet=True)
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert {"density.svg", "speed.svg", "W.svg", "loading.svg", "energies.svg", "tip.svg", "animation.gif"} <= names
    assert Image.open(skfsink.load(tmp_path / "run").plot(tmp_path / "a.png")).format == "PNG"  # whatever the others
    assert "speed.png" not in names
    text = (tmp_path / "run" / "density.svg").read_text()
    assert "last frame" in text and "<!-- end" not in text
    assert not (tmp_path / "run" / "summary.json").exists()
