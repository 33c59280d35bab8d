"""The pictures: what is drawn is the live body and nothing else, in files of the right size."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import pytest
from bodies import grid, notched
from PIL import Image

from skfsink.fem.space import Space
from skfsink.pictures import body as deformed
from skfsink.pictures import moving, plot
from skfsink.pictures.moving import animation
from skfsink.pictures.plot import comparison_picture, density_picture, ledger_picture, tip_picture
from skfsink.results.frame import Frame
from skfsink.results.history import HISTORY_COLUMNS

SIDE, NOTCH = 4.0, 1.0
DPI = 60


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few dots, to be fast; and settings of the user, which must not matter nor change."""
    monkeypatch.setattr(plot, "DPI", DPI)
    with matplotlib.rc_context({"font.size": 31.0}):
        yield
        assert matplotlib.rcParams["font.size"] == 31.0


@pytest.fixture(scope="module")
def plate() -> Space:
    return notched(31, SIDE, NOTCH)


def cracked(space: Space, tip: float, wild: float = 0.0, time: float = 2e-5) -> Frame:
    """A straight crack from the notch to x = `tip`, open; its spent nodes fly about by `wild` [mm]."""
    x, y = space.X[:, 0], space.X[:, 1] - SIDE / 2
    distance = np.hypot(np.maximum(x - tip, 0), np.maximum(np.abs(y) - 0.2, 0))
    gamma = np.maximum(1 - np.exp(-distance / 0.1), 1e-15)
    u = np.zeros_like(space.X)
    u[:, 1] = 0.05 * np.sign(y) * np.clip(tip - x, 0, 1)
    spent = gamma < deformed.SPENT
    u[spent] += wild * np.random.default_rng(0).normal(size=(spent.sum(), 2))
    return Frame(time, "", u, gamma, (gamma[space.conn] < 1e-6).all(axis=1))


def history(quasistatic: bool = False) -> dict[str, np.ndarray]:
    """A made-up run: two rows of loading, then an event that keeps its energy."""
    n = 30
    s = np.linspace(0, 1, n)
    event = dict.fromkeys(HISTORY_COLUMNS, np.zeros(n))
    event |= {"step": np.arange(n), "time_s": 0 * s if quasistatic else 1e-4 * s, "elastic": 0.07 - 0.05 * s,
              "kinetic": 0.02 * s, "sink_stored": 0.02 * s, "sink_kinetic": 0.01 * s, "U_paper": 0.06 * s,
              "tip_x_mm": 1 + 3 * s, "tip_y_mm": 2 + 0 * s, "tip_z_mm": np.full(n, np.nan), "crack_length_mm": 3 * s,
              "tip_speed_m_per_s": np.where(s > 0, 27.0, np.nan), "branches": (3 * s).astype(int)}
    event["phase"] = np.full(n, "event")
    return {name: np.concatenate([values[:2], values]) for name, values in event.items()} | {
        "phase": np.array(["loading"] * 2 + ["event"] * n)}


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def area(triangles: np.ndarray) -> np.ndarray:
    """Signed areas of the triangles (nt, 3, ...) in the plane of the picture."""
    a, b = triangles[:, 1, :2] - triangles[:, 0, :2], triangles[:, 2, :2] - triangles[:, 0, :2]
    return (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2


def on_plate(x: np.ndarray) -> bool:
    """Whether all points (..., 2) are on the plate, give or take the opening of the crack."""
    return bool(np.all((x > -0.06) & (x < SIDE + 0.06)))


# --- what is drawn ---
def test_dead_elements_are_not_drawn(plate: Space) -> None:
    frame = cracked(plate, 3.0)
    elements, x = deformed.live_elements(plate, frame)
    dead = frame.deleted | (frame.gamma[plate.conn] < deformed.SPENT).all(axis=1)
    assert dead.sum() > 40
    np.testing.assert_array_equal(elements, np.flatnonzero(~dead))
    assert x.shape == (len(elements), 4, 2)


def test_deleted_elements_are_not_drawn_whatever_their_density(plate: Space) -> None:
    frame = Frame(0.0, "", np.zeros_like(plate.X), np.ones(plate.n_nodes), np.arange(plate.n_elements) % 7 == 0)
    np.testing.assert_array_equal(deformed.live_elements(plate, frame)[0], np.flatnonzero(~frame.deleted))


def test_spent_nodes_move_with_their_element(plate: Space) -> None:
    calm, wild = cracked(plate, 3.0), cracked(plate, 3.0, wild=1e3)
    elements, x = deformed.live_elements(plate, calm)
    again, y = deformed.live_elements(plate, wild)
    np.testing.assert_array_equal(elements, again)
    np.testing.assert_array_equal(x, y)
    assert on_plate(x)


def test_the_picture_does_not_show_where_spent_nodes_are(plate: Space, tmp_path: Path) -> None:
    for name, wild in (("calm", 0.0), ("wild", 1e3)):
        density_picture(plate, [cracked(plate, 3.0, wild)], tmp_path / f"{name}.png")
    assert (tmp_path / "calm.png").read_bytes() == (tmp_path / "wild.png").read_bytes()


@pytest.mark.parametrize("stretch", [1.0, 6.0])
def test_torn_elements_are_not_drawn(plate: Space, stretch: float) -> None:
    """Fails if an element that spans a crack is drawn as a streak, or one that is stretched as all others is not."""
    u, gamma = (stretch - 1) * plate.X * [0, 1], np.ones(plate.n_nodes)
    u[plate.conn[100, 0]] += [40.0, 0.0]  # a cracked node far away that is not spent
    gamma[plate.conn[100, 0]], gamma[plate.conn[400]] = 0.05, 0.05
    frame = Frame(0.0, "", u, gamma, np.zeros(plate.n_elements, bool))
    elements, x = deformed.live_elements(plate, frame)
    torn = (plate.conn == plate.conn[100, 0]).any(axis=1)
    np.testing.assert_array_equal(elements, np.flatnonzero(~torn))
    assert on_plate(x / [1, stretch])


def test_what_has_not_cracked_is_drawn_however_far_it_is_stretched(kind: str) -> None:
    """Fails if a stretch alone, uniform or next to a stiffer part, makes a hole in an intact body."""
    space = Space(grid(kind, (6, 6, 2)[:2 if kind == "quad" else 3]))
    still = np.ones(space.n_nodes), np.zeros(space.n_elements, bool)
    along = space.X[:, 1]
    for place in (6 * along, np.where(along < 0.5, along, 0.5 + 20 * (along - 0.5))):
        u = np.zeros_like(space.X)
        u[:, 1] = place - along
        elements, x = deformed.live_elements(space, Frame(0.0, "", u, *still))
        np.testing.assert_array_equal(elements, np.arange(space.n_elements))
        np.testing.assert_allclose(x, (space.X + u)[space.conn])


def test_the_body_ends_where_gamma_falls_below_a_tenth() -> None:
    space = Space(grid("quad", (7, 5)))
    still = np.zeros_like(space.X), np.zeros(space.n_elements, bool)
    for gamma, share in ((space.X[:, 0], 0.9), (1.0 - space.X[:, 1], 0.9), (space.X.sum(axis=1), 0.995)):
        (body,), _, ratio = deformed.bodies(space, [Frame(0.0, "", still[0], gamma, still[1])], deformed.OBLIQUE)
        assert area(body.triangles).min() > -1e-12
        assert area(body.triangles).sum() == pytest.approx(share, rel=1e-12)
        assert body.triangles[:, :, 2].min() == pytest.approx(0.1)
        assert ratio == pytest.approx(1.0)


def test_fragments_do_not_widen_the_axes(plate: Space) -> None:
    u, gamma = np.zeros_like(plate.X), np.ones(plate.n_nodes)
    here = np.abs(plate.X - [3.0, 3.0]).max(axis=1)
    gamma[(here > 0.15) & (here < 0.35)] = 1e-15  # a ring around a fragment
    u[here < 0.15] = [50.0, 0.0]
    _, box, _ = deformed.bodies(plate, [Frame(0.0, "", u, gamma, np.zeros(plate.n_elements, bool))], deformed.OBLIQUE)
    np.testing.assert_allclose(box, [[-0.08, -0.08], [4.08, 4.08]])


def test_a_block_shows_the_faces_towards_the_observer() -> None:
    space = Space(grid("hex", (3, 4, 5), (1.0, 2.0, 3.0)))
    gamma, u = np.ones(space.n_nodes), np.zeros_like(space.X)
    deleted = np.zeros(space.n_elements, bool)
    for view, share in (((-90.0, 90.0), 2.0), ((-90.0, 0.0), 3.0), ((0.0, 0.0), 6.0), ((45.0, 0.0), 9 / np.sqrt(2))):
        (body,), _, _ = deformed.bodies(space, [Frame(0.0, "", u, gamma, deleted)], view)
        assert area(body.triangles).min() > -1e-12
        assert area(body.triangles).sum() == pytest.approx(share)
    (body,), box, _ = deformed.bodies(space, [Frame(0.0, "", u, gamma, deleted)], (-90.0, 90.0))
    np.testing.assert_allclose(box, [[-0.04, -0.04], [1.04, 2.04]], atol=1e-12)  # x to the right, y up
    deleted[space.X[space.conn][:, :, 2].max(axis=1) > 2.9] = True
    deleted[:6] = True
    (body,), _, _ = deformed.bodies(space, [Frame(0.0, "", u, gamma, deleted)], (-90.0, 90.0))
    assert area(body.triangles).sum() == pytest.approx(2.0)  # the layer below shows


# --- the files ---
@pytest.mark.parametrize("count, rows", [(1, 1), (2, 1), (3, 1), (4, 2)])
def test_density_picture_has_a_panel_for_each_frame(plate: Space, tmp_path: Path, count: int, rows: int) -> None:
    frames = [cracked(plate, 1.0 + i, time=1e-5 * i) for i in range(count)]
    density_picture(plate, frames, tmp_path / "density.png", "a title")
    picture = pixels(tmp_path / "density.png")
    height, width, _ = picture.shape
    assert width == plot.WIDTH * DPI and height <= plot.TALLEST * DPI
    intact = np.abs(picture - np.round(255 * np.array(plot.GAMMA_MAP(1.0)[:3]))).max(axis=2) <= 1
    assert 0.2 < intact.mean() < 0.9
    covered = intact[:, :int(0.8 * width)].mean(axis=0) > 0.2
    across = np.count_nonzero(np.diff(covered.astype(int)) == 1) + covered[0]
    assert across == -(-count // rows)
    dark = (picture.sum(axis=2) < 250).mean()
    assert 0.001 < dark < 0.2


def test_a_body_in_space_is_drawn(tmp_path: Path) -> None:
    space = Space(grid("hex", (12, 12, 2), (4.0, 4.0, 0.2)))
    gamma = np.where(np.abs(space.X[:, 1] - 2) + np.maximum(space.X[:, 0] - 2, 0) < 0.2, 1e-15, 1.0)
    frame = Frame(1e-5, "arrival", np.zeros_like(space.X), gamma, (gamma[space.conn] < 0.5).all(axis=1))
    density_picture(space, [frame, frame], tmp_path / "block.png", view=(-60.0, 40.0))
    assert len(np.unique(pixels(tmp_path / "block.png").reshape(-1, 3), axis=0)) > 100


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_ledger_picture(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"ledger.{suffix}"
    ledger_picture(history(), path, "a title")
    first = path.read_bytes()
    if suffix == "png":
        picture = pixels(path)
        assert picture.shape[:2] == (4.2 * DPI, plot.WIDTH * DPI)
        for name in ("elastic", "kinetic", "sink_stored", "sink_kinetic"):
            colour = np.round(255 * np.array(matplotlib.colors.to_rgb(plot.BANDS[name][1])))
            assert np.count_nonzero(np.abs(picture - colour).max(axis=2) <= 1) > 1000
        ledger_picture(history(), path, "a title")
        assert path.read_bytes() == first
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_curves_of_a_quasi_static_run_are_over_the_passes(tmp_path: Path) -> None:
    event, time, label, unit = plot._event(history(quasistatic=True))
    np.testing.assert_array_equal(time, np.arange(30))
    assert (label, unit) == ("pass", "N mm/mm") and set(event["phase"]) == {"event"}
    ledger_picture(history(quasistatic=True), tmp_path / "ledger.png")
    tip_picture(history(quasistatic=True), tmp_path / "tip.png", "", np.nan, np.nan)
    assert pixels(tmp_path / "tip.png").std() > 10


def test_time_is_in_microseconds_and_the_unit_follows_the_dimension() -> None:
    _, time, label, unit = plot._event(history())
    assert time[-1] == pytest.approx(100.0) and label == "time since onset (µs)" and unit == "N mm/mm"
    assert plot._event(history() | {"tip_z_mm": np.zeros(32)})[3] == "N mm"
    with pytest.raises(ValueError, match="no rows of the event"):
        plot._event(history() | {"phase": np.full(32, "loading")})


def test_tip_picture(tmp_path: Path) -> None:
    tip_picture(history(), tmp_path / "tip.png", "a title", 29.35, 28.0)
    picture = pixels(tmp_path / "tip.png")
    assert picture.shape[0] == 4.2 * DPI and picture.std() > 10
    tip_picture(history(), tmp_path / "other.png", "a title", 40.0, 28.0)
    assert np.any(pixels(tmp_path / "other.png") != picture)


def test_comparison_picture(plate: Space, tmp_path: Path) -> None:
    comparison_picture(plate, cracked(plate, 3.5), cracked(plate, 2.5, time=np.nan), history(),
                       history(quasistatic=True), tmp_path / "comparison.png", title="a title")
    picture = pixels(tmp_path / "comparison.png")
    assert picture.shape[1] == plot.WIDTH * DPI and picture.std() > 10


def test_animation_has_a_picture_for_each_frame_and_lasts_some_seconds(plate: Space, tmp_path: Path) -> None:
    frames = [cracked(plate, 1.2 + 0.5 * i, wild=10.0, time=1e-5 * i) for i in range(5)]
    animation(plate, frames, tmp_path / "run.gif")
    with Image.open(tmp_path / "run.gif") as gif:
        assert gif.n_frames == 5 and gif.info["loop"] == 0
        lasts = []
        for i in range(5):
            gif.seek(i)
            lasts.append(gif.info["duration"])
    assert 5000 <= sum(lasts) <= 10000 and lasts[-1] > lasts[0]
    assert (tmp_path / "run.gif").stat().st_size < 3e6


def test_animation_of_a_long_run_leaves_frames_out(plate: Space, tmp_path: Path,
                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moving, "GIF_FRAMES", 3)
    animation(plate, [cracked(plate, 1.2 + 0.3 * i, time=1e-5 * i) for i in range(8)], tmp_path / "run.gif")
    with Image.open(tmp_path / "run.gif") as gif:
        assert gif.n_frames == 3


def test_titles() -> None:
    nothing = np.zeros(0)
    assert [Frame(time, label, nothing, nothing, nothing).title for time, label in
            ((1.23e-5, "onset"), (np.nan, "end"), (0.0, ""), (np.nan, ""))] == ["onset, 12.3 µs", "end", "0.0 µs", ""]
