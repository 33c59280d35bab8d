"""Where a body begins to fail, and what it arrives at: clamps, notches, planes of symmetry, sheets."""

from __future__ import annotations

import dataclasses
import json
import logging
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from bodies import grid, notched
from guarded import scene
from plates import invoke_program
from skfem.io.meshio import to_meshio

from skfsink.fem.space import Space
from skfsink.fields.state import State
from skfsink.loads.grips import Grip, Ramp
from skfsink.meshing.sample import Sample
from skfsink.results.loader import load
from skfsink.results.tables import key_table
from skfsink.run.observers import places
from skfsink.scene.scene import Scene
from skfsink.sweep.table import read_rows

PLATE = notched(15)  # 1 x 1 mm, a notch of 0.4 mm from the left at mid-height, l = 0.1 mm


def sides(space: Space) -> dict[str, np.ndarray]:
    """The sides of a box by their names."""
    return {name: np.flatnonzero(np.isclose(space.X[:, i], end(space.X[:, i])))
            for i, names in enumerate((("left", "right"), ("bottom", "top"), ("back", "front"))[:space.dim])
            for name, end in zip(names, (np.min, np.max))}


def body(space: Space = PLATE, grips: tuple[Grip, ...] = (), **more: Any) -> Scene:
    """A body whose boundaries are its sides and those of `more`, pulled at top and bottom."""
    boundaries = {**sides(space), **more.pop("boundaries", {})}
    of = dataclasses.replace(scene(Sample("body", space, boundaries)), **more)
    return dataclasses.replace(of, grips=grips) if grips else of


def weak(space: Space, *place: float, spread: float = 0.1) -> State:
    """An intact state that is weakest at the node nearest to a place, and less so up to `spread` [mm] around it."""
    state = State.intact(space)
    distance = np.linalg.norm(space.X - place, axis=1)
    state.gamma = 1 - 0.1 * np.exp(-((distance - distance.min()) / spread) ** 2)
    return state


def warned(caplog: pytest.LogCaptureFixture, of: Scene, state: State) -> list[str]:
    """What is said of the place of the onset."""
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        places.check_beginning(of, state)
    return [record.getMessage() for record in caplog.records]


# --- the onset ---
def test_the_boundary_where_it_begins():
    """Fails if the boundary is not the nearest one within l, or a notch is called by the side it opens to."""
    notch = np.flatnonzero((PLATE.X[:, 0] < 0.41) & (np.abs(PLATE.X[:, 1] - 0.5) < 0.04))
    of = body(boundaries={"notch": notch, "everything": np.arange(PLATE.n_nodes)})

    def at(*place: float) -> Any:
        return places.beginning(of, weak(PLATE, *place))["boundary"]

    assert at(0.4, 0.53) == at(0.0, 0.53) == "notch"
    assert at(0.5, 1.0) == at(0.5, 0.93) == "top" and at(1.0, 0.6) == "right" and at(0.7, 0.6) == "inside"
    assert places.beginning(body(), weak(PLATE, 0.4, 0.53))["boundary"] == "surface"
    assert places.beginning(of, State.intact(PLATE))["boundary"] == "everywhere"
    assert places.beginning(of, weak(PLATE, 0.4, 0.53))["place_mm"] == pytest.approx([0.4, 0.5333], abs=1e-3)


def test_failure_at_a_clamp_is_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if a body that fails at its grip passes without a word, or one that slides along a plane is blamed."""
    (text,) = warned(caplog, body(), weak(PLATE, 0.0, 1.0))
    assert text.startswith("the body begins to fail at the grip top, at (0, 1) mm") and "wider ends" in text
    sliding = body(grips=(Grip("top", (None, 1e-3)), Grip("bottom", (None, -1e-3)), Grip("left", (0.0, None))),
                   space=Space(grid("quad", (15, 15))))
    assert warned(caplog, sliding, weak(sliding.sample.space, 0.0, 1.0)) == []
    assert warned(caplog, body(), State.intact(PLATE)) == []


def test_failure_away_from_the_notch_is_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if a body with a notch that fails elsewhere passes without a word, or a smooth one is taken for notched."""
    (text,) = warned(caplog, body(), weak(PLATE, 0.9, 0.5))
    assert "(0.867, 0.467) mm (inside), 0.467 mm away from its notch" in text
    assert warned(caplog, body(), weak(PLATE, 0.5, 0.5)) == []
    assert warned(caplog, body(Space(grid("quad", (15, 15)))), weak(PLATE, 0.5, 0.5)) == []
    named = body(Space(grid("quad", (15, 15))), boundaries={"Hole-1": np.array([0])})
    assert "away from its notch" in warned(caplog, named, weak(named.sample.space, 0.5, 0.5))[0]


# --- planes of symmetry ---
def test_planes_of_symmetry():
    """Fails if a flat boundary that only holds its normal is an edge, or one that clamps or moves is not."""
    space = Space(grid("quad", (15, 15)))

    def planes(*grips: Grip, **more: Any) -> list[str]:
        return [name for name, _ in places.symmetry_planes(body(space, grips, **more))]

    pull, still = Grip("top", (0.0, 1e-3)), Ramp((0.0, 1.0), (0.0, 0.0))
    assert planes(pull, Grip("bottom", (None, 0.0))) == planes(pull, Grip("bottom", (None, still))) == ["bottom"]
    assert planes(pull, rollers=(Grip("left", (0.0, None)),)) == ["left"]
    assert planes(pull, Grip("bottom", (0.0, 0.0))) == planes(pull, Grip("bottom", (None, -1e-3))) == []
    assert planes(pull, Grip("bottom", (None, 0.0)), Grip("bottom", (0.0, None))) == []
    assert planes(pull, Grip("bottom", (0.0, None))) == []  # held along itself
    rim, _ = places.rim_of(body(space, (pull, Grip("bottom", (None, 0.0)))))
    assert rim.size == 4 * 15 - 14


def half_mesh(path: Path, nx: int = 20, ny: int = 10, slit: float = 0.5) -> None:
    """The upper half of a plate of 2 x 2 mm with a slit from its left edge; the plane is that beyond the slit."""
    mesh = to_meshio(grid("quad", (nx, ny), (2.0, 1.0)))
    X, n = mesh.points, np.arange(len(mesh.points))
    meshio.Mesh(np.column_stack([X[:, :2], 0 * X[:, 0]]), [("quad", mesh.cells[0].data)], point_sets={
        "plane": n[(X[:, 1] == 0) & (X[:, 0] >= slit - 1e-9)], "pull": n[X[:, 1] == 1.0]}).write(path)


HALF = ('case = "custom"\n[parameters]\nmesh = "half.inp"\nlength_scale = "0.15 mm"\nelement = "planestress"\n'
        'analysis = "quasistatic"\n[[grips]]\nboundary = "pull"\nx = 0\ny = "1e-3 mm/s"\n[[grips]]\n'
        'boundary = "plane"\ny = 0\n')
SHEET = ('case = "custom"\n[parameters]\nmesh = "sheet.vtu"\nlength_scale = "0.3 mm"\nanalysis = "quasistatic"\n'
         '{}[[grips]]\nboundary = "top"\nx = 0\ny = "1e-3 mm/s"\nz = 0\n[[grips]]\nboundary = "bottom"\nx = 0\n'
         'y = 0\nz = 0\n')


def run(folder: Path, deck: str, name: str = "run") -> dict[str, Any]:
    """The summary of a run of a deck."""
    (folder / "deck.toml").write_text(deck)
    status, err, _ = invoke_program("run", folder / "deck.toml", "--out", folder / name, "--quiet")
    assert status == 0, err
    summary: dict[str, Any] = json.loads((folder / name / "summary.json").read_text())
    return summary


def test_a_crack_arrives_along_the_plane_of_a_half_model(tmp_path: Path):
    """Fails if arrival, U and D there are empty in a half model, or come before the far edge is cracked.

    The place of the onset is in the summary, the report and the table of a sweep.
    """
    half_mesh(tmp_path / "half.inp")
    summary = run(tmp_path, HALF)
    assert summary["event"]["separated"] and summary["event"]["first_arrival_pass"] > 5
    assert summary["energy"]["U_paper_at_arrival"] > 0 and summary["energy"]["D_sink_at_arrival"] > 0
    assert not any("arrival" in text for text in summary["warnings"])
    found = load(tmp_path / "run")
    frame = found.frames["arrival"]
    assert frame.point_data["gamma"][np.isclose(frame.points[:, 0], 2.0)].min() < 0.1
    assert summary["onset"]["place_mm"] == [0.5, 0.0] and summary["onset"]["boundary"] == "bottom"
    cells = {row.name: row.cells for row in key_table([found], ["run"], [None]).rows}
    assert cells["where it begins to fail"] == ("bottom, (0.5, 0) mm",)
    (row,) = read_rows([tmp_path], [{}])
    assert (row["onset_boundary"], row["onset_x"], row["onset_y"], row["onset_z"]) == ("bottom", 0.5, 0.0, None)


def test_a_sheet_without_faces_says_what_to_name(tmp_path: Path):
    """Fails if arrival, U and D there are empty without a word, or are empty with the faces named."""
    mesh = grid("hex", (10, 7, 1), (2.0, 1.4, 0.2))
    x, y, _ = mesh.p[:, mesh.t].mean(axis=1)
    to_meshio(mesh.remove_elements(np.flatnonzero((x < 0.6) & (np.abs(y - 0.7) < 0.05)))).write(tmp_path / "sheet.vtu")
    without = run(tmp_path, SHEET.format(""))
    assert without["event"]["separated"] and without["energy"]["U_paper_at_arrival"] is None
    (text,) = (text for text in without["warnings"] if "without a first arrival" in text)
    assert 'faces = "front, back"' in text
    named = run(tmp_path, SHEET.format('faces = "front, back"\n'), "named")
    assert named["energy"]["U_paper_at_arrival"] > 0
    assert not any("without a first arrival" in text for text in named["warnings"])
