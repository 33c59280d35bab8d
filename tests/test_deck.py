"""Decks: what is read from them, in which units, and what is refused."""

from __future__ import annotations

import os
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from plates import deck, invoke, invoke_program, plate

from skfsink.__main__ import COMMANDS
from skfsink.cli.show import deck_text
from skfsink.errors import OutputError, ParameterError, SkfsinkError
from skfsink.meshing.vtu import write_mesh
from skfsink.results.loader import load
from skfsink.scene.deck import read_deck
from skfsink.scene.registry import CASES, find_case, find_case_of_run
from skfsink.scene.stored import StoredScene
from skfsink.system.shipped import shipped_decks
from skfsink.units import in_unit

REFERENCES = sorted((Path(__file__).resolve().parents[1] / "cases").glob("*/reference/*/scene.toml"))


def parameters(folder: Path, text: str, case: str = "single_edge_notch") -> dict[str, Any]:
    """Parameters read from a deck with these lines."""
    return dict(read_deck(deck(folder, f'case = "{case}"\n[parameters]\n{text}\n')).parameters)


# --- units ---
@pytest.mark.parametrize(("text", "unit", "value"), [
    ("5 mm", "mm", 5), ("5mm", "mm", 5), ("0.5 cm", "mm", 5), ("-2e-3 m", "mm", -2), ("60 µm/min", "mm/s", 1e-3),
    ("1.433 g/cm^3", "kg/m^3", 1433), ("0.1686 N/mm^2", "MPa", 0.1686), ("168.6 kPa", "MPa", 0.1686),
    ("10", "", 10), ("150 µs", "s", 1.5e-4),
    # as people write them
    ("1433 kg/m3", "kg/m^3", 1433), ("1433 kg/m³", "kg/m^3", 1433), ("1433 kg m^-3", "kg/m^3", 1433),
    ("1433 kg m-3", "kg/m^3", 1433), ("1433 kg·m⁻³", "kg/m^3", 1433), ("1433 kg⋅m⁻³", "kg/m^3", 1433),
    ("1433 kg m**-3", "kg/m^3", 1433), ("1433 kg*m^-3", "kg/m^3", 1433), ("1.433e-9 t/mm^3", "kg/m^3", 1433),
    ("1.433×10⁻⁹ t/mm³", "kg/m^3", 1433), ("1.433 x 10^-9 t/mm3", "kg/m^3", 1433), ("1.433 g/cm3", "kg/m^3", 1433),
    ("1.433·10⁻⁹ t·mm⁻³", "kg/m^3", 1433), ("0.1686 N/mm2", "MPa", 0.1686), ("0.1686 N/mm²", "MPa", 0.1686),
    ("0.1686 N mm⁻²", "MPa", 0.1686), ("0.1686 N/(mm²)", "MPa", 0.1686), ("2 kN/mm2", "MPa", 2000),
    ("2e6 kg/(m s2)", "MPa", 2), ("2e6 kg/(m·s²)", "MPa", 2), ("2e6 kg/m/s2", "MPa", 2), ("5 MN/m²", "MPa", 5),
    ("1 mPa s", "MPa s", 1e-9),
    ("5 µs", "s", 5e-6), ("5 \u03bcs", "s", 5e-6), ("5 \u00b5m", "mm", 5e-3), ("3 mm s^-1", "mm/s", 3),
    ("3 mm·s⁻¹", "mm/s", 3), ("3 mm s-1", "mm/s", 3), ("3 mm / s", "mm/s", 3), ("3\u00a0mm/s", "mm/s", 3),
    ("3\tmm/s", "mm/s", 3), ("3\u202fmm", "mm", 3), ("−3 mm", "mm", -3), ("50°", "degree", 50), ("+5 mm", "mm", 5)])
def test_quantities(text: str, unit: str, value: float) -> None:
    """Fails if a unit is converted wrongly."""
    assert in_unit("x", text, unit) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(("text", "unit", "said"), [
    ("5 kg", "mm", "expected [length]"), ("5", "mm", "quantity in mm"), ("10 mm", "", "pure number"),
    ("5 bananas", "mm", "'bananas' is no unit"), ("mm", "mm", "'1.5 mm'"), ("nan mm", "mm", "nan"),
    ("5 mm^99", "mm", "'5 mm^99'"), ("1e9999 mm", "mm", "1e9999"), ("5 mm; import os", "mm", "import"),
    ("1,5 mm", "mm", "decimals stand after a point"), ("1.000,5 mm", "mm", "decimals"), ("-1,000 mm", "mm", "decimals"),
    ("1,5", "", "decimals"), ("1 J/m s", "MPa", "may be read in two ways"), ("5 m2", "mm", "[length] ** 2"),
    ("5 mm²", "mm", "[length] ** 2"), ("5 Mpa", "MPa", "capitals count: MPa"),
    ("5 mPa", "MPa", "mPa is a thousandth of a pascal: write MPa"),
    ("5 mPa/s", "MPa/s", "write MPa"), ("1e3x10^3 mm", "mm", "1e3x10^3"),
    ("5 N-mm", "mm", "N-mm"), ("1 (m", "mm", "1 (m"), ("5 mm ^2", "mm", "5 mm ^2"), ("5 °C", "mm", "expected [length]"),
    ("5 degC", "mm", "expected [length]"), ("9" * 500, "mm", "99")])
def test_what_is_no_quantity(text: str, unit: str, said: str) -> None:
    """Fails if a mistake of dimension passes, or the message does not say what is expected."""
    with pytest.raises(ParameterError, match="width must be") as error:
        in_unit("width", text, unit)
    assert said in str(error.value)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 300


@pytest.mark.parametrize("case", CASES)
def test_every_length_time_and_stress_has_a_unit(case: str) -> None:
    """Fails if a parameter whose help names a unit has none in a deck, or another one."""
    for name, parameter in find_case(case).parameters.items():
        said = re.findall(r"\[([A-Za-z/^0-9 ]*[A-Za-z][A-Za-z/^0-9 ]*)\]", parameter.meaning)
        assert said == ([parameter.unit] if parameter.unit else []), (name, parameter)
    deck = deck_text(case)
    refused = find_case(case).refused
    for name, unit in (("length_scale", "mm"), ("density", "kg/m^3"), ("speed", "mm/s"), ("phi", "MPa"),
                       ("hht_dt", "s")):
        if name in refused:
            continue
        assert re.search(rf'(?m)^{name} = ".* {re.escape(unit)}"$', deck), name


# --- reading ---
@pytest.mark.parametrize("case", CASES)
def test_the_deck_that_is_shown_has_the_defaults(case: str, tmp_path: Path) -> None:
    """Fails if `show` leaves a parameter out, or has one that the case refuses, or its text does not read back."""
    read = read_deck(deck(tmp_path, deck_text(case)))
    assert read.case == case
    shown = {name: value for name, value in find_case(case).defaults.items() if name not in find_case(case).refused}
    assert dict(read.parameters) == shown and {"analysis", "phi", "mesh"} <= shown.keys()


@pytest.mark.parametrize("path", REFERENCES, ids=lambda path: "-".join(path.parts[-4:-1:2]))
def test_the_scene_of_a_run_is_a_deck(path: Path) -> None:
    """Fails if what a run writes cannot be run again."""
    read, written = read_deck(path), tomllib.loads(path.read_text())
    assert read.case == written["case"]
    for name, value in written["parameters"].items():
        assert read.parameters[name] == value
    assert StoredScene.read(path.parent).case == read.case


def test_a_mesh_file_is_sought_from_the_folder_of_the_deck(tmp_path: Path) -> None:
    """Fails if a deck works only from the folder it is in."""
    assert parameters(tmp_path, 'mesh = "meshes/plate.vtu"')["mesh"] == str(tmp_path / "meshes/plate.vtu")
    assert parameters(tmp_path, 'mesh = "coarse"')["mesh"] == "coarse"


def test_a_path_from_the_home_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if `~` is taken for a folder of that name beside the deck, in a path of a mesh or of points."""
    for variable in ("HOME", "USERPROFILE"):
        monkeypatch.setenv(variable, str(tmp_path / "home"))
    (tmp_path / "home").mkdir()
    assert parameters(tmp_path, 'mesh = "~/plate.vtu"')["mesh"] == str(tmp_path / "home" / "plate.vtu")
    (tmp_path / "home" / "pull.csv").write_text("0, 0\n1, 2 mm\n")
    write_mesh(tmp_path / "plate.vtu", plate())
    grips = '[[grips]]\nboundary = "top"\ny = "~/pull.csv"\n'
    path = deck(tmp_path, f"case = 'custom'\n[parameters]\nmesh = 'plate.vtu'\n{grips}")
    assert read_deck(path).parameters["grips"][0]["y"] == [[0.0, 0.0], [1.0, 2.0]]
    with pytest.raises(ParameterError, match=r"mesh: the home folder in '~nobody-here/x\.vtu' is not known: give"):
        parameters(tmp_path, 'mesh = "~nobody-here/x.vtu"')


@pytest.mark.parametrize(("text", "said"), [
    ("case = 5", "case must be a name"), ('case = "nothing"', "case must be one of"), ("", "case must be a name"),
    ('case = "costum"\n[[grips]]\nx = 0', "case must be one of"), ("[[grips]]\nx = 0", "case must be a name"),
    ('case = "simple_shear"\nmesh = "M4"', "unknown key 'mesh'; the keys are case, p"), ("case = ", "is no deck"),
    ('case = "simple_shear"\n[parameters]\nsides = 5', "'sides' is no parameter"),
    ('case = "simple_shear"\n[parameters]\nout = "/etc"', "'out' is no parameter; `skfsink show simple_shear` lists"),
    ('case = "simple_shear"\n[parameters]\nlengthscale = 1', "'lengthscale' is no parameter; 'length_scale' is one"),
    ('case = "simple_shear"\n[parameters]\nEvent-time = 1', "parameter; 'event_time' is one"),
    ('case = "simple_shear"\n[parameters]\nside = [5]', "side must be a number, or text with a unit such as '1.5 mm'"),
    ('case = "simple_shear"\n[parameters]\nside = true', "side must be a number"),
    ('case = "simple_shear"\n[parameters]\nside = "5 s"', "expected [length]"),
    ('case = "simple_shear"\n[parameters]\nhalf = 1', "half must be true or false"),
    ('case = "simple_shear"\n[parameters]\nsink = 1', "sink must be text"),
    ('case = "simple_shear"\nparameters = 5', "parameters a table"),
    ("a = " + "[" * 5000, "is no deck"), ("x" * 1_000_001, "more than 1,000,000 bytes")])
def test_what_is_no_deck(text: str, said: str, tmp_path: Path) -> None:
    """Fails if a mistake passes or gives anything but one line with the file and the cause."""
    with pytest.raises(ParameterError) as error:
        read_deck(deck(tmp_path, text))
    assert said in str(error.value)
    assert "deck.toml" in str(error.value)
    assert "\n" not in str(error.value)


def test_no_run_to_resume(tmp_path: Path) -> None:
    """Fails if a folder without a run, or with a foreign scene, is not refused."""
    with pytest.raises(OutputError, match="holds no run"):
        StoredScene.read(tmp_path)
    (tmp_path / "scene.toml").write_text('case = "../../etc"\n[parameters]\n')
    with pytest.raises(OutputError, match=r"scene\.toml is not the scene of a run: its case is '\.\./\.\./etc'"):
        find_case_of_run(StoredScene.read(tmp_path), tmp_path)


# --- files of other programs ---
TEXT = 'case = "single_edge_notch"\n\n[parameters]\nside = "5 mm"\t# größe\nmesh = "plate.vtu"\n'


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le-bom", "utf-16-be-bom", "utf-32"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(encoding: str, end: str, tmp_path: Path) -> None:
    """Fails if a deck that an editor of Windows has saved is not read as it is meant, or a stored scene is not."""
    content = TEXT.replace("\n", end).encode(encoding.removesuffix("-bom"))
    mark = {"utf-16-le-bom": b"\xff\xfe", "utf-16-be-bom": b"\xfe\xff"}.get(encoding, b"")
    for name in ("deck.toml", "scene.toml"):
        (tmp_path / name).write_bytes(mark + content)
    assert read_deck(tmp_path / "deck.toml").parameters == {"side": 5.0, "mesh": str(tmp_path / "plate.vtu")}
    assert StoredScene.read(tmp_path).case == "single_edge_notch" == load(tmp_path).case
    assert StoredScene.read(tmp_path).parameters["side"] == "5 mm"


@pytest.mark.parametrize(("content", "said"), [
    (TEXT.encode("latin-1"), "line 4 has a character that is no UTF-8 (byte 0xf6): save the file as UTF-8"),
    (TEXT.encode("utf-16-le"), "UTF-16 without a byte order mark: save it as UTF-8"),
    (TEXT.encode("utf-16-be"), "UTF-16 without a byte order mark: save it as UTF-8"),
    (TEXT.encode("utf-16")[:-1], "save the file as UTF-8")])
def test_what_is_no_text(content: bytes, said: str, tmp_path: Path) -> None:
    """Fails if a file in another encoding is refused without its cure."""
    (tmp_path / "deck.toml").write_bytes(content)
    with pytest.raises(ParameterError) as error:
        read_deck(tmp_path / "deck.toml")
    assert said in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(("line", "said"), [
    (r'mesh = "..\dir\mesh.inp"', r"for \ in a path write /, or put the path in single quotes"),
    *((line, r"for \ in a path write /") for line in (
        r'mesh = "..\test\mesh.inp"', r'mesh = "C:\Users\me\m.inp"', r'mesh = "..\new\mesh.inp"',
        r'mesh = "..\bodies\mesh.inp"')),
    ("side = 1,5", "decimals stand after a point"), ('side = "1,5 mm"', "decimals stand after a point"),
    ("side = 5 mm", 'text stands in quotes, as in "5 mm"'), ("mesh = M3", "text stands in quotes"),
    ("mesh = “M3”", "write straight quotes"), ('side: "5 mm"', "write = between name and value"),
    ("mesh = ../a.inp", "text stands in quotes"),
    ('side = 5\nside = 6\n# the end\n', "line 4 gives side a second time: leave one"),
    ('side = 5\n[parameters]\nside = 6', "line 4 has the table parameters again: leave one, or, where there may be"),
    ("[[grips]]\nx = 0\n[grips]\nx = 0", "or, where there may be several, write [[grips]] for each"),
    ("[grips]\nx = 0\n\n  [[ grips ]]  # two\nx = 0", "line 6 has the table grips again"),
    ("side = 5\nside = [\n 1,\n 2]", "Cannot overwrite a value")])
def test_usual_mistakes_have_their_cure(line: str, said: str, tmp_path: Path) -> None:
    """Fails if a mistake that people make in decks is refused without saying what to write instead."""
    with pytest.raises(ParameterError) as error:
        parameters(tmp_path, line)
    assert said in str(error.value) and "\n" not in str(error.value) and "deck.toml" in str(error.value)


@pytest.mark.skipif(os.sep != "/", reason="a path of this system")
def test_a_path_of_windows(tmp_path: Path) -> None:
    """Fails if a path with backslashes is refused here without its cure."""
    (tmp_path / "dir").mkdir()
    write_mesh(tmp_path / "dir" / "plate.vtu", plate())
    for path in (r"dir\plate.vtu", r"C:\Users\me\plate.vtu"):
        name = deck(tmp_path, f"case = 'single_edge_notch'\n[parameters]\nmesh = '{path}'\n")
        status, err, _ = invoke_program("run", name, "--out", tmp_path / "out", "--quiet")
        assert status == 2 and err.count("\n") == 1 and "folders are parted by / here, not by \\" in err, err


# --- hostile ---
VALUES = st.one_of(st.integers(), st.floats(), st.booleans(), st.text(max_size=30), st.sampled_from(
    ["5 mm", "1e-3 mm/s", "inf", "../../x.vtu", "\u0000", "1 MPa", "jbar", "auto", "0", "-1 mm", "9" * 40]))


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, int | float) else '"' + "".join(
        f"\\u{ord(c):04x}" if ord(c) < 0x10000 and not 0xD800 <= ord(c) < 0xE000 else "?" for c in value) + '"'


def _no_traceback(path: Path) -> None:
    before = sorted(path.parent.iterdir())
    try:
        read_deck(path)
    except SkfsinkError as error:
        assert len(str(error).splitlines()) == 1
    assert sorted(path.parent.iterdir()) == before


ODD = settings(max_examples=300, deadline=None, database=None,
               suppress_health_check=[HealthCheck.function_scoped_fixture])
MANY = settings(ODD, max_examples=5000)
BYTES = st.binary(max_size=300)
TABLES = st.dictionaries(st.sampled_from([*find_case("dog_bone").parameters, "x", ""]), VALUES, max_size=8)


def check_bytes(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "deck.toml"
    path.write_bytes(content)
    _no_traceback(path)


def check_table(tmp_path: Path, case: str, table: dict[str, Any]) -> None:
    lines = [f'"{name}" = {_toml(value)}' for name, value in table.items()]
    check_bytes(tmp_path, "\n".join([f'case = "{case}"', "[parameters]", *lines]).encode())


@ODD
@given(BYTES)
@example(b"\xff\xfe")
def test_any_bytes(tmp_path: Path, content: bytes) -> None:
    """Fails if bytes that are no deck give anything but one line."""
    check_bytes(tmp_path, content)


@ODD
@given(st.sampled_from(CASES), TABLES)
def test_any_values(tmp_path: Path, case: str, table: dict[str, Any]) -> None:
    """Fails if a value of any kind gives anything but one line."""
    check_table(tmp_path, case, table)


@pytest.mark.slow
@MANY
@given(BYTES, st.integers(0, 10**6), st.sampled_from(CASES), TABLES)
def test_ten_thousand_variants(tmp_path: Path, content: bytes, place: int, case: str, table: dict[str, Any]) -> None:
    """Fails if one of 5,000 broken decks and 5,000 of odd values gives anything but one line."""
    whole = deck_text(case).encode()
    place %= len(whole)
    check_bytes(tmp_path, whole[:place] + content + whole[place + len(content):])
    check_table(tmp_path, case, table)


def test_a_deck_runs_with_other_parameters(tmp_path: Path) -> None:
    """Fails if what Python changes of a deck is dropped or refused: a mesh, text with a unit, tables, a function."""
    for n in (9, 13):
        write_mesh(tmp_path / f"{n}.vtu", plate(n))
    read = read_deck(deck(tmp_path, 'case = "custom"\n[parameters]\nmesh = "9.vtu"\nlength_scale = "0.6 mm"\n'
                                    '[[grips]]\nboundary = "top"\ny = 1\n[[grips]]\nboundary = "bottom"\ny = 0\n'))
    grips = [{"boundary": "top", "x": 0, "y": "2 mm/s"}, {"boundary": "bottom", "x": 0, "y": 0}]
    scene = read.scene(mesh=tmp_path / "13.vtu", phi="200 kPa", grips=grips)
    assert scene.sample.space.n_elements > 13 * 12 and scene.sink_law.phi == 0.2
    assert scene.grips[0].velocity == (0.0, 2.0) and read.scene().grips[0].velocity == (None, 1.0)
    run = read.run(mesh=str(tmp_path / "13.vtu"), phi="0.2 MPa", grips=grips, stop=lambda view: "far enough",
                   out=tmp_path / "run", quiet=True)
    assert run.summary["elements"] == scene.sample.space.n_elements and "far enough" in run.summary["end"]
    assert load(tmp_path / "run").parameters["phi"] == 0.2
    with pytest.raises(ParameterError, match="phi must be"):
        read.run(phi="3 mm", out=tmp_path / "no")
    assert read.changed(m=8).parameters["m"] == 8 and "m" not in read.parameters


# --- the program ---
@pytest.mark.slow
def test_run_and_resume_from_a_deck(tmp_path: Path) -> None:
    """Fails if the program does not run a deck, or its results differ from those of the case's own command line."""
    write_mesh(tmp_path / "plate.vtu", plate())
    path = deck(tmp_path, 'case = "single_edge_notch"\n[parameters]\nmesh = "plate.vtu"\nphi = "160 kPa"\n'
                          'length_scale = "0.6 mm"\nevent_time = "2 µs"\n')
    status, err, _ = invoke_program("run", path, "--out", tmp_path / "deck", "--quiet")
    assert status == 0, err
    status, err, _ = invoke("--mesh", tmp_path / "plate.vtu", "--phi", 0.16, "--length-scale", 0.6,
                            "--event-time", 2e-6, "--out", tmp_path / "flags", "--quiet")
    assert status == 0, err
    assert (tmp_path / "deck/history.csv").read_bytes() == (tmp_path / "flags/history.csv").read_bytes()
    assert (tmp_path / "deck/scene.toml").read_bytes() == (tmp_path / "flags/scene.toml").read_bytes()
    status, err, _ = invoke_program("resume", tmp_path / "deck", "--quiet")
    assert status == 0, err


def test_messages_have_the_words_of_a_deck(tmp_path: Path) -> None:
    """Fails if a message names a parameter otherwise than the deck that is to be corrected."""
    words = [word for path in (Path(__file__).resolve().parents[1] / "skfsink").rglob("*.py")
             for word in re.findall(r'\b(?:require|choose|in_unit|number_in)\(f?"([^"]+)"',
                                    path.read_text(encoding="utf-8"))]
    assert len(words) > 50 and [word for word in words if "-" in word] == []
    with pytest.raises(ParameterError, match="event_time must be a finite number"):
        read_deck(deck(tmp_path, 'case = "dog_bone"\n[parameters]\nevent_time = "-1 s"')).scene()


def test_what_is_listed_is_shown_and_every_command_is_named() -> None:
    """Fails if `show` does not know a deck of `list`, or a wrong command is answered by a part of those there are."""
    for name, path in shipped_decks().items():
        status, err, out = invoke_program("show", name)
        assert (status, err) == (0, "") and (name in CASES or out == path.read_text(encoding="utf-8")), name
    assert "pure_shear" in invoke_program("show", "trousers")[1]
    assert invoke_program("nope") == (2, f"skfsink: command must be one of {', '.join(COMMANDS)}; got 'nope'\n", "")


@pytest.mark.parametrize("arguments", [["list"], ["show", "dog_bone"], ["--help"], ["run", "--help"]])
def test_commands_that_only_say(arguments: list[str]) -> None:
    """Fails if a command of the program cannot be called."""
    status, err, out = invoke_program(*arguments)
    assert (status, err) == (0, "")
    said = {"list": "cylindrical_shell", "show": "gauge_width = ", "run": "--overwrite", "--help": "resume"}
    assert said[arguments[0]] in out
