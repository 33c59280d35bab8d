"""Scenes of your own: decks with tables, mesh files with named boundaries and regions, and the same from Python."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from plates import contents, deck, invoke_program, plate

from skfsink.cases.custom import CASE, custom
from skfsink.errors import MeshError, ParameterError, SkfsinkError
from skfsink.loads.grips import Grip, Ramp, Traction
from skfsink.loads.schedule import Loading
from skfsink.material import (
    LIMITERS,
    MATERIALS,
    Gent,
    HolzapfelGasserOgden,
    SinkLaw,
    constants_text,
    own_constants,
    read_constants,
)
from skfsink.material.regions import RegionLaw
from skfsink.meshing.sample import file_sample
from skfsink.meshing.vtu import write_mesh
from skfsink.results.loader import load
from skfsink.scene.deck import read_deck
from skfsink.scene.options import Options
from skfsink.scene.stored import TABLES, StoredScene
from skfsink.scene.tables import grips_of, read_tables, regions_of

HEAD = 'case = "custom"\n[parameters]\nmesh = "plate.vtu"\nlength_scale = 0.6\nevent_time = "5 µs"\n'
GRIPS = '[[grips]]\nboundary = "top"\nx = 0\ny = "1 µm/s"\n[[grips]]\nboundary = "bottom"\nx = 0\ny = -1e-3\n'


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with the mesh of the small plate."""
    write_mesh(tmp_path / "plate.vtu", plate())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_deck_its_scene_file_and_python_give_the_same_run(folder: Path) -> None:
    """Fails if one of the three ways to the same scene gives another result, or a resumed run refuses its own."""
    assert invoke_program("run", deck(folder, HEAD + GRIPS), "--out", "first", "--quiet") == (0, "", "")
    assert invoke_program("run", folder / "first" / "scene.toml", "--out", "second", "--quiet")[0] == 0
    grips = [Grip("top", (0.0, 1e-3)), Grip("bottom", (0.0, -1e-3))]
    options = Options(length_scale=0.6, event_time=5e-6, out=Path("third"), quiet=True)
    result = custom(mesh="plate.vtu", grips=grips, options=options)
    for name in ("history.csv", "scene.toml", "series/run.pvd"):
        first = (folder / "first" / name).read_bytes()
        assert (folder / "second" / name).read_bytes() == first == (result.folder / name).read_bytes(), name
    before = contents(folder / "first" / "series")
    assert invoke_program("resume", "first", "--quiet")[0] == 0
    read_deck(folder / "deck.toml").run(resume=folder / "first", quiet=True)
    custom(grips=grips, options=Options(resume=folder / "first", quiet=True))
    assert contents(folder / "first" / "series") == before
    with pytest.raises(ParameterError, match="grips are not those of the run in first; a resumed run keeps its scene"):
        custom(grips=grips[:1], options=Options(resume=Path("first"), quiet=True))


def test_custom_plate_is_the_case_of_the_same_plate(folder: Path) -> None:
    """Fails if a scene of your own is computed otherwise than the same scene of a case."""
    case = 'case = "single_edge_notch"\n' + HEAD.partition("\n")[2]
    assert invoke_program("run", deck(folder, HEAD + GRIPS), "--out", "own", "--quiet")[0] == 0
    assert invoke_program("run", deck(folder, case), "--out", "case", "--quiet")[0] == 0
    assert (folder / "own" / "history.csv").read_bytes() == (folder / "case" / "history.csv").read_bytes()


def test_material_of_a_deck(folder: Path) -> None:
    """Fails if a law chosen in a deck, its constants or the limiter that belongs to it do not reach the scene."""
    text = HEAD + 'material = "gent"\nconstants = "mu = 300 kPa, limit = 80"\n' + GRIPS
    own, options = read_deck(deck(folder, text)).check()
    scene = CASE.scene({"title": "", "faces": "", "tractions": (), "regions": (), **own}, options)
    assert scene.material == Gent(500.0, 1433.0, 0.3, 80.0)
    assert scene.sink_law.phi == LIMITERS["gent"].phi == scene.parameters["phi"]
    assert Options(material="gent", phi=0.5).sink_law().phi == 0.5
    assert Options().parameters()["phi"] == 0.1686


@pytest.mark.parametrize("law", MATERIALS)
def test_constants_as_text(law: str) -> None:
    """Fails if the constants of a law do not survive being written and read."""
    material = MATERIALS[law]()
    assert MATERIALS[law](**read_constants(law, constants_text(material))) == material


def test_constants_with_units_and_vectors() -> None:
    """Fails if units or the components of a vector are misread."""
    found = read_constants("hgo", "c = 7.64 kPa, angle = 0.5 radian, axis = 0 1 0, kappa=.1")
    assert found["c"] == pytest.approx(0.00764) and found["axis"] == (0.0, 1.0, 0.0) and found["kappa"] == 0.1
    assert found["angle"] == pytest.approx(np.degrees(0.5))
    assert HolzapfelGasserOgden(**found).axis == (0.0, 1.0, 0.0)


@pytest.mark.parametrize(("law", "text", "said"), [
    ("gent", "mu", "name = value pairs between commas, of mu, limit for gent"), ("gent", "eta = 1", "got 'eta = 1'"),
    ("gent", "mu = 1 mm", "mu must be a quantity in MPa"), ("gent", "mu = 1, mu = 2", "mu is there twice"),
    ("gent", "bulk_modulus = 5", "of mu, limit"), ("yeoh", "c1 = x", "c1 must be")])
def test_what_are_no_constants(law: str, text: str, said: str) -> None:
    """Fails if a mistake in constants passes, or is not named."""
    with pytest.raises(ParameterError) as error:
        Options(material=law, constants=text)
    assert said in str(error.value)


# --- E, G and nu ---
@pytest.mark.parametrize(("law", "besides"), [
    ("aaa", "c2 = 2 MPa"), ("neo-hookean", ""), ("yeoh", "c2 = 0.1"), ("mooney-rivlin", "c2 = 10 kPa"),
    ("gent", "limit = 50"), ("arruda-boyce", "segments = 5")])
def test_engineering_constants(law: str, besides: str) -> None:
    """Fails if E, G or nu do not come out of the tangent modulus of the undeformed solid."""
    E, nu = 1.2, 0.45
    G, k = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu))
    for text in (f"E = {E} N/mm², nu = {nu}", f"nu = {nu}, G = {G * 1e3!r} kPa"):
        found = MATERIALS[law](**read_constants(law, ", ".join(filter(None, [text, besides]))))
        assert found.shear_modulus == pytest.approx(G, rel=1e-12)
        assert found.bulk_modulus == pytest.approx(k, rel=1e-12)
        A = found.modulus(np.eye(3))  # of the undeformed solid: stress of a uniaxial strain, then free sides
        side = A[1, 1, 0, 0] / (A[1, 1, 1, 1] + A[1, 1, 2, 2])
        assert side == pytest.approx(nu, rel=1e-9)
        assert A[0, 0, 0, 0] - 2 * side * A[0, 0, 1, 1] == pytest.approx(E, rel=1e-9)
    assert read_constants(law, f"G = 1, {besides}").keys() & {"bulk_modulus"} == set()
    text, bulk = own_constants(law, f"E = {E} MPa, nu = {nu}, {besides}")
    assert MATERIALS[law](**read_constants(law, text), bulk_modulus=bulk or 0) == MATERIALS[law](
        **read_constants(law, f"E = {E} MPa, nu = {nu}, {besides}"))
    if besides:
        assert own_constants(law, besides) == (besides, None)


@pytest.mark.parametrize(("law", "text", "said"), [
    ("gent", "E = 1, nu = 0.5", "nu must be in (-1, 0.5); got 0.5: nu = 0.5 is incompressible: give nu = 0.4999, or"),
    ("gent", "E = 1, nu = -1", "nu must be in (-1, 0.5); got -1"), ("gent", "E = 1, nu = 0.7", "got 0.7"),
    ("gent", "E = 1 MPa", "give nu as well"), ("gent", "E = -1, nu = 0.3", "E must be"),
    ("gent", "E = 1, G = 1, nu = 0.3", "E and G of gent say the same"),
    ("gent", "mu = 1, G = 1", "G and mu of gent say the same"), ("gent", "E = 1 mm, nu = 0.3", "quantity in MPa"),
    ("mooney-rivlin", "E = 1, nu = 0.4", "give c2 as well"), ("hgo", "E = 1, nu = 0.4", "hgo has fibres"),
    ("mooney-rivlin", "G = 0.1, nu = 0.4, c2 = 1", "would be -0.95 MPa"), ("gent", "E = 1, E = 1", "E is there twice"),
    ("yeoh", "c1 = 1, E = 1, nu = 0.3", "E and c1 of yeoh"), ("gent", "mu = 0,27 MPa", "decimals stand after a point"),
    ("aaa", "E = 1", "give nu as well"), ("aaa", "c1 = 1", "c1 and c2, or E, G and nu")])
def test_engineering_constants_that_do_not_fit(law: str, text: str, said: str) -> None:
    """Fails if moduli that contradict each other, or leave something open, are taken."""
    with pytest.raises(ParameterError) as error:
        Options(material=law, constants=text)
    assert said in str(error.value) and "\n" not in str(error.value)


def test_a_deck_with_engineering_constants_is_stored_in_those_of_the_law(folder: Path) -> None:
    """Fails if scene.toml leaves open what was computed, if E and nu are another run than mu and k, or are no run."""
    region = '[[regions]]\nname = "stiff"\nmaterial = "yeoh"\nconstants = "E = 3 N/mm^2, nu = 0.49"\nphi = 1\n'
    mesh = plate()
    middle = mesh.points[mesh.cells_dict["quad"]].mean(axis=1)
    mesh.cell_sets["stiff"] = [np.flatnonzero(middle[:, 0] > 3), np.zeros(0, int)]
    write_mesh(folder / "plate.vtu", mesh)
    text = HEAD + 'material = "neo-hookean"\nconstants = "E = 3.6 MPa, nu = 0.49"\n' + GRIPS + region
    assert invoke_program("run", deck(folder, text), "--out", "first", "--quiet")[0] == 0
    written = tomllib.loads((folder / "first" / "scene.toml").read_text())
    G = 3.6 / 2.98
    assert read_constants("neo-hookean", written["parameters"]["constants"]) == {"mu": pytest.approx(G)}
    assert written["parameters"]["bulk_modulus"] == pytest.approx(3.6 / 0.06)
    assert written["regions"][0]["bulk_modulus"] == pytest.approx(50) and "E" not in written["regions"][0]["constants"]
    assert invoke_program("run", "first/scene.toml", "--out", "second", "--quiet")[0] == 0
    assert invoke_program("resume", "first", "--quiet")[0] == 0
    for name in ("history.csv", "scene.toml"):
        assert (folder / "second" / name).read_bytes() == (folder / "first" / name).read_bytes()


def test_a_mesh_in_metres_is_told_before_its_crack_is_sought(folder: Path) -> None:
    """Fails if a body in metres with a crack in mm is told that the crack leaves it, which hides the cause."""
    mesh = plate()
    write_mesh(folder / "plate.vtu", meshio.Mesh(1e-3 * mesh.points, mesh.cells))
    crack = '[[cracks]]\nname = "cut"\npoints = [["0 mm", "2 mm"], ["1 mm", "2 mm"]]\nlips = "whole"\n'
    code, err, _ = invoke_program("run", deck(folder, HEAD + GRIPS + crack), "--out", "run")
    assert code == 2 and "multiply those of a mesh in m by 1000 (skfsink mesh IN OUT --from m)" in " ".join(err.split())


def test_constants_of_a_command_have_units() -> None:
    """Fails if a quantity is no constant of `skfsink material`, is taken without its unit, or has another's."""
    shown = invoke_program("material", "gent", "--mu", "300 kPa", "--density", "1.1 g/cm^3")
    assert shown[0] == 0 and "mu 0.3" in str(shown) and "density 1100" in str(shown)
    assert invoke_program("material", "gent", "--mu", "0.3", "--density", "1100")[1:] == shown[1:]
    assert "mu must be a quantity in MPa" in str(invoke_program("material", "gent", "--mu", "3 kg"))


def test_a_region_without_a_law_has_that_of_the_body() -> None:
    """Fails if a region of another strength alone has another law, or other constants, than the body around it."""
    body, sink = Gent(mu=0.02, limit=5.0), SinkLaw(phi=0.3, m=8.0, length_scale=0.2)
    assert RegionLaw("strong", phi=10.0).laws(body, sink) == (body, replace(sink, phi=10.0))
    assert RegionLaw("heavy", density=2e3).laws(body, sink) == (replace(body, density=2e3), sink)
    assert regions_of([{"name": "strong", "phi": "10 MPa"}])[0].laws(body, sink)[0] == body


@pytest.mark.parametrize(("options", "said"), [
    ({"bulk_modulus": 400.0}, "say the same"), ({"given_names": frozenset({"bulk_modulus"})}, "say the same")])
def test_two_bulk_moduli_are_refused(options: dict[str, Any], said: str) -> None:
    """Fails if one of two bulk moduli is taken without a word, even where the other is the default."""
    with pytest.raises(ParameterError, match=said):
        Options(material="gent", constants="mu = 1, nu = 0.49", **options)
    with pytest.raises(ParameterError, match=said):
        RegionLaw("r", "gent", "mu = 1, nu = 0.49", bulk_modulus=1.0).laws(Gent(), Options().sink_law())
    with pytest.raises(ParameterError, match="region r: bulk_modulus 1 MPa and the nu"):
        regions_of([{"name": "r", "material": "gent", "constants": "nu = 0.4", "bulk_modulus": "1 MPa"}])


def test_engineering_constants_of_aaa() -> None:
    """Fails if E, G and nu of the paper's law go past its options c1, c2, or contradict them without a word."""
    of = Options(constants="nu = 0.49", c1=1.0).stored_energy()
    assert of.bulk_modulus == pytest.approx(2 * 2.0 * 1.49 / (3 * 0.02)) and of.shear_modulus == 2.0
    of = Options(constants="G = 3 MPa", c2=0.5)
    assert of.parameters()["c1"] == 1.5 and of.parameters()["constants"] == "" and of.parameters()["c2"] == 0.5
    assert Options(**of.parameters()).stored_energy() == of.stored_energy()
    with pytest.raises(ParameterError, match=r"c1 1\.0 MPa and the G of the constants say the same"):
        Options(constants="G = 3 MPa", c1=1.0)


def test_engineering_constants_of_the_command() -> None:
    """Fails if `skfsink material` takes other names than decks do."""
    status, err, out = invoke_program("material", "gent", "--E", "1.2", "--nu", "0.45", "--density", "1000")
    assert (status, err) == (0, "")
    assert "bulk_modulus 4, density 1000, viscosity 0, mu 0.413793" in " ".join(out.split())
    status, err, _ = invoke_program("material", "gent", "--nu", "0.45", "--bulk-modulus", "4")
    assert status == 2 and "say the same" in err and err.count("\n") == 1
    assert "bulk_modulus 4," in invoke_program("material", "gent", "--G", "1", "--bulk-modulus", "4")[2]


@pytest.mark.parametrize(("options", "said"), [
    ({"constants": "c1 = 1"}, "constants are those of another law than aaa"), ({"phi": -1.0}, "phi must be"),
    ({"material": "gent", "c1": 0.5}, "c1 is a constant of aaa"),
    ({"material": "steel"}, "material must be one of aaa")])
def test_options_of_the_material_that_cannot_be(options: dict[str, Any], said: str) -> None:
    """Fails if an option that does not belong to the law is silently left out."""
    with pytest.raises(ParameterError) as error:
        Options(**options)
    assert said in str(error.value)


# --- tables ---
def test_tables_keep_what_they_say(tmp_path: Path) -> None:
    """Fails if a grip, traction or region changes in being written and read, or units are misread."""
    grips = read_tables("grips", [{"boundary": "top", "x": 0, "z": [["1 min", "1 cm"], [120, 20]]}])
    assert grips == ({"boundary": "top", "x": 0.0, "z": [[0.0, 0.0], [60.0, 10.0], [120.0, 20.0]]},)
    assert grips_of(grips, 3)[0] == Grip("top", (0.0, None, Ramp((60.0, 120.0), (10.0, 20.0))))
    assert read_tables("tractions", [{"boundary": "a", "y": "10 kPa/s"}]) == ({"boundary": "a", "y": 0.01},)
    region = {"name": "core", "material": "gent", "constants": "mu = 1 MPa", "phi": "500 kPa", "density": "1 g/cm^3"}
    assert read_tables("regions", [region]) == (region | {"phi": 0.5, "density": 1000.0},)
    parameters = {"mesh": "a.vtu", **dict.fromkeys(TABLES, ()), "grips": grips}
    StoredScene("custom", parameters).write(tmp_path)
    assert StoredScene.read(tmp_path) == StoredScene("custom", {**parameters, "grips": list(grips)})


def tomllib_text(data: dict[str, Any]) -> str:
    """TOML of a table."""
    import tomli_w

    return tomli_w.dumps(data)


@pytest.mark.parametrize(("tables", "said"), [
    ("[[grips]]\nx = 0", "grips: boundary must be a name"), ("[[grips]]\nboundary = 'top'\nw = 0", "unknown key 'w'"),
    ("[[grips]]\nboundary = 'top'", "grip top holds nothing: give it x, y, z, normal or angle"),
    ("[[grips]]\nboundary = 'top'\ny = '1 mm'", "grip top, y must be a quantity in mm/s"),
    ("[[grips]]\nboundary = 'top'\ny = true", "grip top, y must be a number"),
    ("[[grips]]\nboundary = 'top'\ny = [[0, 0]]", "a ramp must have at least two points"),
    ("[[grips]]\nboundary = 'top'\ny = [[0, 0], [0, 1]]", "times of a ramp must ascend; got 0, 0"),
    ("[[grips]]\nboundary = 'top'\ny = [0, 1]", "a ramp has 2 to 1000 points"),
    ("[[grips]]\nboundary = 'top'\ny = nan", "grip top, y must be a finite number"),
    ("grips = 5", "grips must be tables [[grips]]"),
    ("[grips]\nboundary = 'top'", "grips must be tables [[grips]], with two "),
    ("[[tractions]]\nboundary = 'top'\ny = '1 MPa'", "traction top, y must be a quantity in MPa/s, or a ramp of "
     "points [time, value] such as [['0 s', '0 MPa'], ['1 s', '1 MPa']]; got '1 MPa'"),
    ("[[tractions]]\nboundary = 'top'\ny = '1 N'", "traction top, y must be a quantity in MPa/s, such as '1.5 MPa/s'"),
    ("[[regions]]\nname = 'a'\nmaterial = 'steel'", "region a: material must be one of"),
    ("[[regions]]\nname = 'a'\nconstants = 'mu = 1'", "region a: constants 'mu = 1' are those of no law: give a"),
    ("[[regions]]\nname = 'a'\nphi = '1 mm'", "region a, phi must be a quantity in MPa"),
    ("[parameters]\ngrips = []", "grips are tables beside the parameters"),
    ("[[loads]]\n", "unknown key 'loads'; the keys are case, parameters")])
def test_what_are_no_tables(tables: str, said: str, tmp_path: Path) -> None:
    """Fails if a mistake in a table passes, or its line does not say where and what."""
    with pytest.raises(ParameterError) as error:
        read_deck(deck(tmp_path, f'case = "custom"\n{tables}\n'))
    assert said in str(error.value) and "\n" not in str(error.value)


def test_only_custom_scenes_have_tables(tmp_path: Path) -> None:
    """Fails if the grips of a case of the paper seem to be replaced by those of a deck."""
    with pytest.raises(ParameterError, match="unknown key 'grips'; the keys are case, parameters"):
        read_deck(deck(tmp_path, 'case = "simple_shear"\n' + GRIPS))


@pytest.mark.parametrize(("changed", "said"), [
    ({"mesh": "coarse"}, "mesh must be the path of a mesh file"),
    ({"grips": ()}, "at least one grip, traction or pressure"),
    ({"speed": 1.0}, "speed is for the cases"), ({"half": True}, "half is for the cases"),
    ({"model": "auto"}, "model is for the cases"),
    ({"model": "onset"}, "got 'onset': event_time = \"1 ns\" ends the run at the onset"),
    ({"faces": "nope"}, "faces: 'nope' is no boundary of mesh plate, which has bottom, left, notch, right, top;"),
    ({"faces": "left right"}, "'left right' is no boundary"), ({"faces": ["left"]}, "faces must be text, names of"),
    ({"grips": [Grip("top", (0, "1 mm"))]}, "grip top, y must be a quantity in mm/s"),
    ({"tractions": [Traction("top", (True, 0.0))]}, "traction top, x must be a number"),
    ({"grips": [Grip("lid", (0.0, 1.0))]}, "mesh plate has no boundary 'lid'; it has"),
    ({"grips": [Grip("top", (0.0, 1.0, 2.0))]}, "grip top has a component z"),
    ({"tractions": [Traction("top", (0.0, 1.0, 2.0))]}, "traction top has a component z"),
    ({"regions": [RegionLaw("core")]}, "mesh plate has no set of elements 'core'; it has none")])
def test_scenes_that_cannot_be(changed: dict[str, Any], said: str, folder: Path) -> None:
    """Fails if a scene without sense is computed, or its line does not name what is wrong."""
    own = {"mesh": "plate.vtu", "grips": [Grip("top", (0.0, 1e-3)), Grip("bottom", (0.0, 0.0))]}
    options = {k: v for k, v in changed.items() if k in ("speed", "half", "model")}
    own |= {k: v for k, v in changed.items() if k not in options}
    with pytest.raises((ParameterError, MeshError)) as error:
        custom(**own, options=Options(**options, length_scale=0.6, out=folder / "out", quiet=True))
    assert said in str(error.value)
    assert not (folder / "out").exists()


def test_velocities_with_units_from_python() -> None:
    """Fails if a grip from Python cannot have the units that one in a deck has."""
    assert read_tables("grips", [Grip("top", (0, "1 µm/s"))]) == ({"boundary": "top", "x": 0.0, "y": 1e-3},)


# --- mesh files ---
def test_sides_have_names_of_their_own(tmp_path: Path) -> None:
    """Fails if the sides of a mesh without names are not found, or one that the mesh names is replaced."""
    mesh = plate()
    mesh.cell_sets = {"top": [np.zeros(0, int), np.array([0])]}
    write_mesh(tmp_path / "plate.vtu", mesh)
    sample = file_sample(tmp_path / "plate.vtu")
    X = sample.space.X
    for name, axis, end in (("left", 0, 0.0), ("right", 0, 4.0), ("bottom", 1, 0.0)):
        assert (sample.nodes(name) == np.flatnonzero(X[:, axis] == end)).all() and sample.nodes(name).size > 5
    assert sample.nodes("top").size == 2


@pytest.mark.parametrize("suffix", [".vtu", ".inp", ".msh"])
def test_sets_of_nodes_and_elements_are_found_in_mesh_files(suffix: str, tmp_path: Path) -> None:
    """Fails if a set of nodes cannot be a boundary, or a set of elements no region, in a format that has them."""
    mesh = plate()
    middle = mesh.points[mesh.cells_dict["quad"]].mean(axis=1)
    right = np.flatnonzero(middle[:, 0] > 2.0)
    end = np.flatnonzero(mesh.points[:, 1] == 4.0)
    path = tmp_path / f"mesh{suffix}"
    if suffix == ".vtu":
        mesh.cell_sets["half"] = [right, np.zeros(0, int)]
        mesh.cell_sets["lid"] = mesh.cell_sets["top"]
        write_mesh(path, mesh)
    elif suffix == ".inp":
        blocks = meshio.Mesh(mesh.points, [("quad", mesh.cells_dict["quad"])], cell_sets={"half": [right]},
                             point_sets={"lid": end})
        blocks.write(path)
    else:
        lines = mesh.cells_dict["line"]
        tags = [np.where(np.isin(np.arange(len(middle)), right), 1, 2), np.where(np.isin(lines, end).all(axis=1), 3, 4)]
        meshio.Mesh(mesh.points, [("quad", mesh.cells_dict["quad"]), ("line", lines)],
                    cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
                    field_data={"half": np.array([1, 2]), "rest": np.array([2, 2]), "lid": np.array([3, 1])},
                    ).write(path, file_format="gmsh22", binary=False)
    sample = file_sample(path)
    assert (sample.nodes("lid") == end).all()
    assert (sample.elements("half") == right).all()


def test_report_of_a_custom_scene(folder: Path) -> None:
    """Fails if a report cannot be made of it, names it by its kind, or shows tables as they are in the program."""
    assert invoke_program("run", deck(folder, HEAD + 'title = "My plate"\n' + GRIPS), "--out", "run", "--quiet")[0] == 0
    assert invoke_program("report", "run")[0] == 0
    page = (folder / "run" / "report.html").read_text(encoding="utf-8")
    assert "My plate, mesh plate, dynamic (explicit)" in page
    assert "boundary top, x 0, y 0.001; boundary bottom, x 0, y -0.001" in page
    assert "skfsink run run/scene.toml --out FOLDER" in page and "&#39;boundary" not in page


# --- hostile tables ---
ODD = st.one_of(st.integers(-2**60, 2**60), st.floats(), st.booleans(), st.text(max_size=12), st.sampled_from(
    [0, 0.0, 1e-3, "1e-3 mm/s", "1 MPa", "5 s", "top", "left", "half", "gent", "mu = 1 MPa", "steel", "1 kPa/s"]))
RAMPS = st.lists(st.one_of(ODD, st.lists(ODD, max_size=3)), max_size=4)
KEYS = st.sampled_from(["boundary", "x", "y", "z", "name", "material", "constants", "phi", "m", "density",
                        "bulk_modulus", "", "w"])
ENTRIES = st.lists(st.one_of(ODD, st.dictionaries(KEYS, st.one_of(ODD, RAMPS), max_size=5),
                             st.fixed_dictionaries({"boundary": st.sampled_from(["top", "bottom", "nowhere"])},
                                                   optional={"x": st.one_of(ODD, RAMPS), "y": st.one_of(ODD, RAMPS)}),
                             st.fixed_dictionaries({"name": st.just("half")}, optional={
                                 "material": ODD, "constants": ODD, "phi": ODD, "m": ODD, "density": ODD})), max_size=3)
DECKS = st.fixed_dictionaries({}, optional={"grips": st.one_of(ODD, ENTRIES), "tractions": st.one_of(ODD, ENTRIES),
                                            "regions": st.one_of(ODD, ENTRIES), "loads": ENTRIES})
FEW = settings(max_examples=300, deadline=None, database=None, suppress_health_check=list(HealthCheck))


def check_tables(folder: Path, tables: dict[str, Any]) -> None:
    """A deck of these tables makes a scene, or is refused in one line; nothing is written beside it."""
    if not (folder / "half.vtu").exists():
        mesh = plate()
        middle = mesh.points[mesh.cells_dict["quad"]].mean(axis=1)
        mesh.cell_sets["half"] = [np.flatnonzero(middle[:, 0] > 2.0), np.zeros(0, int)]
        write_mesh(folder / "half.vtu", mesh)
    text = tomllib_text({"case": "custom", "parameters": {"mesh": "half.vtu"}, **tables})
    path, before = deck(folder, text), sorted(folder.iterdir())
    try:
        own, options = read_deck(path).check()
        CASE.scene({"title": "", "faces": "", "grips": (), "tractions": (), "regions": (), **own}, options)
    except SkfsinkError as error:
        assert len(str(error).splitlines()) == 1 and len(str(error)) < 700
    assert sorted(folder.iterdir()) == before


@FEW
@given(DECKS)
def test_any_tables(folder: Path, tables: dict[str, Any]) -> None:
    """Fails if tables of any kind give anything but a scene or one line."""
    check_tables(folder, tables)


@pytest.mark.slow
@settings(FEW, max_examples=5000)
@given(DECKS)
def test_five_thousand_tables(folder: Path, tables: dict[str, Any]) -> None:
    """Fails as the test before, on more of them."""
    check_tables(folder, tables)


def test_grips_that_move_a_node_differently_are_refused(folder: Path) -> None:
    """Fails if of two grips with a common corner one silently loses it, or grips that agree there are refused."""
    space = file_sample(folder / "plate.vtu").space
    X = space.X
    bottom, right = np.flatnonzero(X[:, 1] == 0), np.flatnonzero(X[:, 0] == 4.0)
    with pytest.raises(ParameterError, match=r"grips bottom and right both hold x of the node at \(4, 0\)"):
        Loading(space, [(bottom, Grip("bottom", (0.0, 0.0))), (right, Grip("right", (1e-3, None)))])
    for x in (0.0, None):
        Loading(space, [(bottom, Grip("bottom", (x, 0.0))), (right, Grip("right", (0.0, None)))])


def test_a_deck_with_a_region_a_ramp_and_a_traction_runs(folder: Path) -> None:
    """Fails if what a deck says of regions, ramps and tractions does not reach the run, or is lost in resuming it."""
    mesh = plate()
    middle = mesh.points[mesh.cells_dict["quad"]].mean(axis=1)
    mesh.cell_sets["half"] = [np.flatnonzero(middle[:, 0] > 2.0), np.zeros(0, int)]
    write_mesh(folder / "plate.vtu", mesh)
    text = HEAD + ('[[grips]]\nboundary = "bottom"\nx = 0\ny = [["0 s", "0 mm"], ["10 s", "-0.02 mm"]]\n'
                   '[[tractions]]\nboundary = "top"\ny = "2 kPa/s"\n'
                   '[[regions]]\nname = "half"\nmaterial = "neo-hookean"\nphi = "100 kPa"\nconstants = "mu = 2 MPa"\n')
    assert invoke_program("run", deck(folder, text), "--out", "run", "--quiet")[0] == 0
    run = load(folder / "run")
    assert 10.0 in run.history["time_s"] and (run.history["loads"] < 0).any()
    # the load is the resultant of the traction: 4 mm of 2 kPa/s
    loading = run.history["phase"] == "loading"
    assert run.history["reaction_N_per_mm"][loading] == pytest.approx(0.008 * run.history["time_s"][loading], rel=1e-6)
    assert set(run.frames[0].cell_data["region"][0]) == {0, 1}
    region = run.scene.regions[0]
    assert region.sink_law.phi == 0.1 and region.material.shear_modulus == pytest.approx(2.0)
    assert run.summary["energy"]["balance_error_relative"] < 1e-6
    before = contents(folder / "run" / "series")
    assert invoke_program("resume", "run", "--quiet")[0] == 0
    assert contents(folder / "run" / "series") == before
