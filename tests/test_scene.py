"""What defines a run: `scene.toml` makes it again, its fingerprint tells it from others, its grips hold."""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
import tomllib
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import Weight
from plates import SMALL, invoke, invoke_program, plate

from skfsink.cases.custom import custom
from skfsink.cases.single_edge_notch import CASE, single_edge_notch
from skfsink.errors import CheckpointError, MeshError, OutputError, ParameterError, require
from skfsink.fields.state import State
from skfsink.loads.grips import Grip, Ramp
from skfsink.material import MATERIALS, NeoHookean, SinkLaw
from skfsink.material.regions import Region
from skfsink.meshing.symmetry import Whole
from skfsink.meshing.vtu import write_mesh
from skfsink.report.page import report_page
from skfsink.results.loader import load
from skfsink.run.checkpoint import load_state, save_state
from skfsink.run.compute import run
from skfsink.scene.deck import Deck, read_deck
from skfsink.scene.described import made_in_python
from skfsink.scene.digest import digest
from skfsink.scene.options import Options
from skfsink.scene.registry import read_scene
from skfsink.scene.scene import Scene
from skfsink.scene.stored import StoredScene

OWN = {name: p.default for name, p in inspect.signature(single_edge_notch).parameters.items() if name != "options"}


def scene(mesh: Path, **options: Any) -> Scene:
    """The case on that mesh."""
    return CASE.scene({**OWN, "mesh": str(mesh)}, Options(**options))


@pytest.mark.parametrize("arguments", [
    ["--event-time", "2e-5", "--phi", "0.2"], pytest.param(["--analysis", "quasistatic"], marks=pytest.mark.slow),
    pytest.param(["--integrator", "hht", "--event-time", "5e-6", "--sink", "nearest"], marks=pytest.mark.slow)])
def test_scene_file_is_enough_to_run_again(arguments: list[str], mesh: Path, tmp_path: Path,
                                           monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a parameter that decides the result is missing from scene.toml, or loses a bit in it."""
    monkeypatch.chdir(tmp_path)  # the mesh is given relative to it
    assert invoke("--mesh", mesh.name, "--out", "first", *SMALL, *arguments)[0] == 0
    parameters = tomllib.loads((tmp_path / "first" / "scene.toml").read_text())["parameters"]
    assert parameters.keys() == OWN.keys() | Options().parameters().keys()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert parameters["mesh"] == "mesh.npz"  # beside it
    parameters["mesh"] = str(tmp_path / "first" / "mesh.npz")
    options = {name: value for name, value in parameters.items() if name not in OWN}
    result = single_edge_notch(**{name: parameters[name] for name in OWN},
                               options=Options(**options, out=Path("second"), quiet=True))
    flags = [f"--{name.replace('_', '-')}={value}" for name, value in parameters.items()]
    assert invoke(*flags, "--out", "third", "--quiet")[0] == 0
    for name in ("history.csv", "scene.toml", "series/run.pvd"):
        first = (tmp_path / "first" / name).read_bytes()
        assert (result.folder / name).read_bytes() == first == (Path("third") / name).read_bytes()


def test_fingerprint_tells_scenes_apart(mesh: Path, tmp_path: Path) -> None:
    """Fails if a run could be resumed with another parameter or mesh, or not from another place."""
    base = scene(mesh)
    assert base.fingerprint == scene(mesh).fingerprint
    of_named_meshes = ("half", "dimensions", "mesh_layout")
    others = [scene(mesh, **{name: value}) for name, value in Options(
        c1=0.6, c2=1.2, bulk_modulus=501.0, phi=0.17, m=9.0, length_scale=0.11, density=1433.1, speed=2e-3,
        mass_floor=0.0, integrator="hht", hht_alpha=0.0, hht_dt=1e-7, coupling="single",
        mass="consistent", courant=0.7, gamma_every=1, sink="nearest", element="plain", overshoot=0.01,
        force_floor=0.0, deletion=1e-5, event_time=1e-4, aftermath=0.0, record_every=2e-6, frame_every=1e-5,
        balance_tolerance=0.1, threads=2, front=0.5, checkpoint_every=10.0, active_zone=False, start="rest",
        kernels="forms", energy_tolerance=1e-4, gradient="gauss", viscosity=1e-5,
        bulk_viscosity_linear=0.06, bulk_viscosity_quadratic=1.2, raised_mass=0.02, density_solver="jacobi",
        linear="multigrid", fields="W", pictures="svg", series="vtkhdf", stop="arrival").parameters().items()
        if name not in (*of_named_meshes, "analysis", "start", "material", "constants", "contact", "debris",
                        "subcycled")]
    others += [scene(mesh, material="gent"), scene(mesh, material="gent", constants="mu = 0.3")]
    others += [scene(mesh, analysis="quasistatic"), scene(mesh, start="rest"), scene(mesh, contact=True),
               scene(mesh, debris="remove"), scene(mesh, raised_mass=0.0, subcycled=0.001)]
    bodies = []
    for change in (0, 1, 2):
        body = plate(n=13 if change else 11)
        body.points[30, 0] += 1e-12 if change == 1 else 0.0
        if change == 2:
            body.cell_sets["notch"][1] = body.cell_sets["notch"][1][1:-1]
        write_mesh(tmp_path / f"{change}.vtu", body)
        bodies.append(scene(tmp_path / f"{change}.vtu"))
    marks = {s.fingerprint for s in (base, *others, *bodies, replace(base, case="other"))}
    assert len(marks) == 1 + len(others) + len(bodies) + 1
    (tmp_path / "copy").mkdir()
    assert scene(Path(mesh.rename(tmp_path / "copy" / "moved.vtu"))).fingerprint == base.fingerprint


class Stiffer(NeoHookean):
    """A material of your own that its parameters do not tell from another."""

    @property
    def constants(self) -> np.ndarray:
        return 2 * np.array([self.mu])


@dataclass(frozen=True)
class Patchy(NeoHookean):
    """One with a long array."""

    map: Any = None


def test_fingerprint_of_scenes_made_in_python(mesh: Path) -> None:
    """Fails if a checkpoint could be resumed under other physics that no parameter of the scene tells."""
    base = scene(mesh)
    long = np.zeros(5000)
    long[2500] = 1.0
    hurried = replace(base.controls, statics=replace(base.controls.statics, increment=0.02))
    others = [
        *(replace(base, material=one) for one in (NeoHookean(), NeoHookean(mu=1.3), Stiffer(), Patchy())),
         replace(base, material=Patchy(map=long)),
        replace(base, material=Patchy(map=0 * long)),
        replace(base, sink_law=SinkLaw(phi=0.17)), replace(base, sink_law=SinkLaw(epsilon=1e-14)),
        replace(base, controls=replace(base.controls, overshoot=0.006)), replace(base, controls=hurried),
        replace(base, controls=replace(base.controls, frame_every=1e-5)),
        replace(base, controls=replace(base.controls, explicit=replace(base.controls.explicit, estimate_every=7))),
        replace(base, controls=replace(base.controls, threads=2)),
        replace(base, rollers=(Grip("left", (0.0, None)),)), replace(base, faces=("left",)),
        replace(base, whole=Whole(2.0)),
        replace(base, grips=(Grip("top", (0.0, Ramp(tuple(np.arange(2000.0)), tuple(long[:2000])))),)),
        replace(base, sample=replace(base.sample, boundaries={"lid" if name == "notch" else name: nodes for name, nodes
                                                              in base.sample.boundaries.items()})),
        replace(base, regions=(Region("r", np.arange(3), Patchy(map=long), base.sink_law),)),
        replace(base, regions=(Region("r", np.arange(3), Patchy(map=2 * long), base.sink_law),))]
    assert len({s.fingerprint for s in (base, *others)}) == 1 + len(others)
    same = [replace(base, controls=replace(base.controls, checkpoint_every=1.0)), replace(base, title="Other"),
            replace(base, material=replace(base.material, bulk_modulus=500)), replace(base, view=(0.0, 0.0))]
    assert base.material.compiled_law  # is kept from here on
    assert {s.fingerprint for s in (base, *same)} == {base.fingerprint}


@pytest.mark.slow
def test_digests_do_not_depend_on_the_process() -> None:
    """Fails if the hash of a value has an address, the order of a set, or the elided text of an array in it."""
    code = ("from skfsink import Options; from skfsink.scene.digest import digest; o = Options(material='hgo');"
            "print(digest([o.stored_energy(), o.sink_law(), o.controls(), {'a', 'b', 'c'}]))")
    ran = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True,
                          env={**os.environ, "PYTHONHASHSEED": seed}).stdout for seed in "12"]
    assert ran[0] == ran[1]
    assert digest([1, 2.0, True]) == digest((1.0, np.float64(2), 1)) != digest([1, 2])
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1}) != digest({"a": 2, "b": 1})
    values = ("1", 1, b"1", None, "", 2**60, 2**60 + 1, 0.1, [0.1], {0.1}, np.array([0.1]))
    assert len({digest(value) for value in values}) == len(values)


def test_a_checkpoint_of_another_scene_is_refused(mesh: Path, tmp_path: Path) -> None:
    """Fails if a state goes on under another limiter, material or load, or not under its own scene."""
    base, state = scene(mesh), State.intact(scene(mesh).sample.space)
    save_state(tmp_path / "state.npz", base.fingerprint, state)
    assert load_state(tmp_path / "state.npz", base.fingerprint).step == 0
    heavy, heavier = (replace(base, loads=(partial(Weight, rate=rate),)) for rate in (1e-3, 2e-3))
    save_state(tmp_path / "heavy.npz", heavy.fingerprint, state)
    with pytest.raises(CheckpointError, match="another scene"):
        load_state(tmp_path / "heavy.npz", heavier.fingerprint)
    for other in (scene(mesh, phi=0.2), replace(base, material=NeoHookean()), heavy):
        with pytest.raises(CheckpointError, match="another scene"):
            load_state(tmp_path / "state.npz", other.fingerprint)


def test_parts_are_the_scenes_of_single_runs(mesh: Path) -> None:
    """Fails if the halves of `--analysis both` could not be resumed, or rerun, on their own."""
    both = scene(mesh, analysis="both", phi=0.2)
    for analysis in ("dynamic", "quasistatic"):
        alone = scene(mesh, analysis=analysis, phi=0.2)
        assert both.part(analysis).stored() == alone.stored() and both.part(analysis).controls == alone.controls
        assert both.part(analysis).fingerprint == alone.fingerprint


def test_grips_hold_and_move_their_boundaries(mesh: Path) -> None:
    """Fails if a grip slips sideways, moves the wrong way, or holds a node of another boundary."""
    made = scene(mesh, speed=0.25)
    free, velocity = made.constraints()
    y = made.sample.space.X[:, 1]
    held = (y == 0) | (y == 4)
    assert (free.reshape(-1, 2) == ~held[:, None]).all()
    assert (velocity[:, 0] == 0).all() and (velocity[:, 1] == np.select([y == 0, y == 4], [-0.25, 0.25])).all()
    assert made.speed == pytest.approx(0.5)
    slips = replace(made, grips=(Grip("top", (None, 0.25)), Grip("bottom", (0.0, 0.0))))
    assert slips.constraints()[0].reshape(-1, 2)[y == 4].tolist() == [[True, False]] * int((y == 4).sum())
    assert slips.speed == pytest.approx(0.25)


def test_boundaries_must_be_there(mesh: Path) -> None:
    """Fails if a grip that the mesh does not know holds nothing, silently."""
    with pytest.raises(MeshError, match=r"mesh plate has no boundary 'lid'; it has bottom, left, notch"):
        replace(scene(mesh), grips=(Grip("lid", (0.0, 1.0)),))


def test_parts_that_no_parameter_gives(mesh: Path) -> None:
    """Fails if a part of a scene that is not as its parameters say goes unnoticed, or one that is seems not to be."""
    base = scene(mesh, length_scale=0.6)
    gent = Options(half=True, material="gent", constants="E = 1 MPa, nu = 0.49")
    coarse = CASE.scene({**OWN, "mesh": "coarse"}, gent)
    for told in (base, coarse, base.part("quasistatic"), replace(base, title="Other"),
                 replace(base, controls=replace(base.controls, checkpoint_every=1.0))):
        assert made_in_python(told, CASE) == ()
    hurried = replace(base.controls, statics=replace(base.controls.statics, increment=0.02))
    for changes, parts in (({"material": NeoHookean()}, ("material",)), ({"controls": hurried}, ("controls",)),
                           ({"loads": (partial(Weight, rate=1e-3),), "faces": ("left",)}, ("loads", "faces")),
                           ({"grips": base.grips[::-1]}, ("grips",)),
                           ({"parameters": {**base.parameters, "colour": 1}}, ("parameters",))):
        assert made_in_python(replace(base, **changes), CASE) == parts
    moved = replace(coarse.sample, boundaries={**coarse.sample.boundaries, "lid": np.arange(3)})
    assert made_in_python(replace(coarse, sample=moved), CASE) == ("sample",)


def test_a_run_that_its_file_does_not_describe(mesh: Path, tmp_path: Path) -> None:
    """Fails if scene.toml tells another material than the run had, and no one who uses it says so."""
    odd = replace(scene(mesh, length_scale=0.6, event_time=2e-6), material=NeoHookean(mu=0.5))
    folder, said = tmp_path / "odd", "does not describe {} run, parts of which were made in Python (material): "
    result = run(odd, folder, quiet=True)
    assert [text for text in result.summary["warnings"] if "scene.toml" in text] == [
        f"scene.toml beside the results {said.format('this')[:-2]}: it can be resumed and run again from there only"]
    assert load(folder).made_in_python == ("material",)
    page = report_page([load(folder)])
    assert "parts were made in Python (material), which parameters and command do not describe" in page
    history = (folder / "history.csv").read_bytes()
    for arguments, cure in ((("run", folder / "scene.toml"), "run it again from there"),
                            (("resume", folder), "resume it from there, with run(scene, folder, resume=True)")):
        status, err, _ = invoke_program(*arguments)
        assert status == 2 and said.format("its") + cure in err and err.count("\n") == 1
    assert run(odd, folder, quiet=True, resume=True).summary["warnings"] == result.summary["warnings"]
    assert (folder / "history.csv").read_bytes() == history


def test_faces_must_be_boundaries(mesh: Path) -> None:
    """Fails if a crack could arrive at the face of a sheet because its name is misspelt."""
    base = scene(mesh)
    assert replace(base, faces=("left",)).faces == ("left",)
    with pytest.raises(MeshError, match="faces: 'bak' is no boundary of mesh plate, which has bottom, left"):
        replace(base, faces=("left", "bak"))
    with pytest.raises(MeshError, match="mesh plate has no boundary 'bak'"):
        base.sample.rim("bak")


def test_numbers_from_numpy_and_python_write_the_same_scene(mesh: Path) -> None:
    """Fails if a parameter study over an array cannot be written down."""
    values = {"phi": np.float64(0.2), "gamma_every": np.int64(3), "c1": np.float32(0.5)}
    plain = {"phi": 0.2, "gamma_every": 3, "c1": 0.5}
    assert scene(mesh, **values).stored().toml() == scene(mesh, **plain).stored().toml()
    decks = [Deck("single_edge_notch", {"mesh": "coarse", **those}).scene().stored().toml()
             for those in (values, plain)]
    assert decks[0] == decks[1]


def test_scene_files_that_are_none(tmp_path: Path) -> None:
    """Fails if a file that is no scene is read as one of no parameters."""
    for text in ("", "case = 1", "case = 'single_edge_notch'", "case = 'single_edge_notch'\nparameters = 3", "= x"):
        (tmp_path / "scene.toml").write_text(text)
        with pytest.raises(OutputError, match=r"scene\.toml is not the scene of a run"):
            StoredScene.read(tmp_path)


@pytest.mark.parametrize("value", ["1", None, [1], 10**400, np.nan, -np.inf, 2.5, 7, b"1"])
def test_require_takes_whole_numbers_only(value: Any) -> None:
    """Fails if what is no number, or none in the range, passes for one or raises anything else."""
    with pytest.raises(ParameterError, match=r"^count must be a whole number in \[1, 6\] steps; got "):
        require("count", value, "steps", low=1, high=6, whole=True)
    assert require("count", 6, low=1, high=6, whole=True) == require("count", np.float32(6.0), whole=True) == 6.0


# --- what Python is given ---
DECK = Deck("single_edge_notch", {"mesh": "coarse"})


@pytest.mark.parametrize("call, kind, message", [
    (lambda: single_edge_notch(mesh=None), MeshError, "mesh must be the name of a mesh, or the path .*; got None"),
    (lambda: single_edge_notch(mesh=3), MeshError, "mesh must be .*; got 3"),
    (lambda: custom(mesh=None), MeshError, "mesh must be .*; got None"),
    (lambda: single_edge_notch(options=None), ParameterError, r"options must be skfsink.Options; got None: give Opt"),
    (lambda: single_edge_notch(options={"phi": 0.1}), ParameterError, r"options must .* give Options\(\*\*\{...\}\)"),
    (lambda: custom(options=None), ParameterError, "options must be skfsink.Options; got None"),
    (lambda: run("plate.toml", "out"), ParameterError, r"got 'plate.toml': a deck is run by read_deck\(...\).run"),
    (lambda: run(DECK, "out"), ParameterError, r"got Deck\(.*: a deck is run by read_deck\(...\).run"),
    (lambda: run(None, "out"), ParameterError, "run takes a Scene; got None$"),
    (lambda: run(DECK.scene(), None), ParameterError, "folder must be a path; got None"),
    (lambda: Deck("custom", {"foo": 1}).scene(), ParameterError, "'foo' is no parameter"),
    (lambda: Deck("single_edge_notch", {"mesh": 3}).scene(), ParameterError, "mesh must be text; got 3"),
    (lambda: Deck("single_edge_notch", {"side": "4 s"}).scene(), ParameterError, "side must be"),
    (lambda: DECK.run(bogus=1), ParameterError, "'bogus' is no parameter of single_edge_notch; .* out, over"),
    (lambda: read_deck(None), ParameterError, "the path of a deck must be a path; got None"),
    (lambda: read_scene(None), ParameterError, "folder must be a path; got None"),
    (lambda: Options(constants={"mu": 1.0}), ParameterError, r"constants must be text, such as 'mu = .*; got \{'mu'"),
    (lambda: Options(material=["gent"]), ParameterError, r"material must be text; got \['gent'\]"),
    (lambda: Options(overwrite="no"), ParameterError, "overwrite must be true or false; got 'no'"),
    (lambda: Options(quiet=1), ParameterError, "quiet must be true or false; got 1"),
    (lambda: Options(active_zone=1), ParameterError, "active_zone must be true or false; got 1"),
    (lambda: Options(out=3), ParameterError, "out must be a path; got 3"),
    (lambda: Options(resume=[]), ParameterError, r"resume must be a path; got \[\]")])
def test_what_python_is_given_is_checked(call: Any, kind: type[Exception], message: str, tmp_path: Path,
                                         monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a wrong argument is a traceback or is taken in silence, or leaves a folder."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(kind, match=message) as error:
        call()
    assert "\n" not in str(error.value) and not [*tmp_path.iterdir()]


def test_a_law_without_a_limiter_asks_for_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a law that was entered alone is a KeyError, or cannot be used with a limiter."""
    monkeypatch.setitem(MATERIALS, "demiray", NeoHookean)
    with pytest.raises(ParameterError, match="material demiray has no energy limiter of its own: give phi"):
        Options(material="demiray")
    assert Options(material="demiray", phi=0.2).sink_law().phi == 0.2


def test_paths_are_taken_as_text_is(mesh: Path, tmp_path: Path) -> None:
    """Fails if a mesh or a folder is a traceback as a Path or as text."""
    result = single_edge_notch(mesh=mesh, options=Options(length_scale=0.6, event_time=2e-7, quiet=True,
                                                          out=str(tmp_path / "run")))
    assert result.scene.parameters["mesh"] == str(mesh)
    assert read_scene(str(result.folder)).fingerprint == read_scene(result.folder).fingerprint
    coarse = [read.scene().fingerprint for read in (DECK, Deck("single_edge_notch", {"mesh": Path("coarse")}))]
    assert coarse[0] == coarse[1]
