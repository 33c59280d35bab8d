"""The documentation: its examples run, its commands exist, its messages are those of the program, its links hold."""

from __future__ import annotations

import ast
import importlib.util
import re
import shlex
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image
from plates import invoke_program, plate

import skfsink
from skfsink.cli.program import command
from skfsink.fem.backends import BACKENDS
from skfsink.fem.elements import ELEMENTS
from skfsink.fields.sinks import SINKS
from skfsink.material import MATERIALS
from skfsink.meshing import sample
from skfsink.meshing.vtu import write_mesh
from skfsink.methods.controls import StaticsControls
from skfsink.methods.integrators import INTEGRATORS
from skfsink.methods.statics import Statics
from skfsink.results.history import HISTORY_COLUMNS
from skfsink.run import compute
from skfsink.run.observers.history import VALUES
from skfsink.scene.deck import Deck, read_deck
from skfsink.scene.options import Options
from skfsink.scene.registry import CASES, find_case
from skfsink.sweep.vary import read_variation
from skfsink.system.shipped import deck_path

ROOT = Path(__file__).resolve().parents[1]
PAGES = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
         for path in (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"))}
FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
RUN = ("list", "show", "material")  # commands cheap enough to be run
#: errors whose words stand elsewhere: their rows are found by these
ELSEWHERE = {"… … of the onset energy at …, allowed …: …; only then raise balance_tolerance": "energy balance error"}


def blocks(page: str, language: str) -> list[str]:
    """The blocks of a page in a language."""
    return [text for name, text in FENCE.findall(PAGES[page]) if name == language]


def made(name: str) -> ModuleType:
    """A module of docs/make."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / "make" / f"{name}.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# --- examples ---
def blank(path: Path) -> None:
    """A picture in place of one that takes long to draw."""
    Image.new("RGB", (20, 10), "white").save(path)


@pytest.fixture
def registries() -> Iterator[None]:
    """What an example enters in a registry is gone after it."""
    before = [(registry, dict(registry)) for registry in (BACKENDS, ELEMENTS, HISTORY_COLUMNS, INTEGRATORS, MATERIALS,
                                                          SINKS, VALUES)]
    yield
    for registry, content in before:
        registry.clear()
        registry.update(content)


@pytest.fixture
def place(registries: None, tmp_path: Path) -> Iterator[Path]:
    """A folder to run examples in, in which the mesh `coarse` of the plate has 79 elements; with the deck of the
    pages."""
    (tmp_path / "cases" / "meshes").mkdir(parents=True)
    write_mesh(tmp_path / "cases" / "meshes" / "coarse.vtu", plate(9))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compute, "draw_run", lambda scene, folder, *_: blank(folder / "density.png"))
        patch.setattr(compute, "draw_comparison", lambda one, other, folder: blank(folder / "comparison.png"))
        patch.chdir(tmp_path)
        patch.setattr(sample, "data_folder", lambda case: tmp_path / "cases")
        (deck,) = blocks("docs/first_crack.md", "toml")
        (tmp_path / "plate.toml").write_text(deck)
        yield tmp_path


#: what the reader of a block has that the block does not bring, by words in it
BEFORE = {
    'skfsink.load("results/single_edge_notch/M3-dynamic")': """
from skfsink import Options
from skfsink.cases.single_edge_notch import single_edge_notch
single_edge_notch(mesh="coarse", options=Options(length_scale=0.9, quiet=True,
                                                 out="results/single_edge_notch/M3-dynamic"))
""",
    "class AtTheNotch(": """
from plates import plate
from skfsink.meshing import write_mesh
write_mesh("cases/meshes/coarse.vtu", plate(31))  # a domain of 0.6 mm has elements
"""}
#: uses of what a block defines, by words in it
AFTER = {
    "class Demiray(": """
from skfsink import SinkLaw, peaks
assert peaks(Demiray(), SinkLaw(phi=0.1))["uniaxial tension"].stress > 0
""",
    "def double_edge_notch_mesh(": """
import importlib.util
if importlib.util.find_spec("gmsh"):
    assert len(double_edge_notch_mesh(h=0.1, h_coarse=0.2).points) > 100
""",
    "def double_edge_notch(": """
assert CASE.name == "double_edge_notch"  # it is run by test_registry.py
""",
    "class Watchful(": """
from skfsink import Options
from skfsink.cases.single_edge_notch import single_edge_notch
runs = {name: single_edge_notch(mesh="coarse", options=Options(
    length_scale=0.9, event_time=4e-7, gamma_every=8, integrator=name, quiet=True, out=name))
    for name in ("explicit", "watchful")}
solves = [run.summary["cost"]["gamma_solves"] for run in runs.values()]
assert solves[1] > solves[0] and runs["watchful"].summary["integrator"] == "watchful"
""",
    "class Weight(": """
from dataclasses import replace
from skfsink import read_deck
from skfsink.fields import Body
scene = read_deck("plate.toml").scene()
dead = Body.of(replace(scene, loads=heavy)).loading.dead
dead.at(2.0)
assert abs(dead.values[:, 1].sum() + 2e-3 * scene.sample.space.V.sum()) < 1e-9
""",
    "class Halfway(": """
from skfsink import Options
from skfsink.cases.single_edge_notch import single_edge_notch
gammas = {name: single_edge_notch(mesh="coarse", options=Options(
    length_scale=0.9, event_time=4e-7, sink=name, quiet=True, out=name)).state.gamma for name in SINKS}
assert all(not (gammas["halfway"] == gammas[name]).all() for name in ("lumped", "nearest"))
""",
    "def softened_forms(": """
from skfsink import Options
from skfsink.cases.single_edge_notch import single_edge_notch
loads = {name: single_edge_notch(mesh="coarse", options=Options(
    length_scale=0.9, event_time=2e-7, element=name, kernels="forms", quiet=True, out=name)).summary["onset"]
    for name in ("plain", "softened")}
assert loads["softened"]["elastic_energy"] < loads["plain"]["elastic_energy"]
""",
    'HISTORY_COLUMNS["greatest_speed_m_per_s"]': """
from skfsink import Options, load
from skfsink.cases.single_edge_notch import single_edge_notch
single_edge_notch(mesh="coarse", options=Options(length_scale=0.9, event_time=4e-7, quiet=True, out="speeds"))
assert load("speeds").event["greatest_speed_m_per_s"].max() > 0.0
assert load("speeds").event.units["greatest_speed_m_per_s"] == "m/s"
"""}


def programs() -> dict[str, list[str]]:
    """By page its Python blocks, each once."""
    found: dict[str, list[str]] = {}
    for page in sorted(PAGES, reverse=True):
        known = [text for texts in found.values() for text in texts]
        found[page] = [text for text in blocks(page, "python") if text not in known]
    return {page: texts for page, texts in found.items() if texts}


def around(text: str, pieces: dict[str, str]) -> list[str]:
    """Those of the pieces whose words are in a block."""
    return [piece for words, piece in pieces.items() if words in text]


@pytest.mark.slow
@pytest.mark.parametrize("page", programs())
def test_every_block_runs(page: str, place: Path) -> None:
    """Fails if a Python block, one after the other on its page, ends with an error, or what it defines is of no use."""
    names = {"__name__": "example"}
    for text in programs()[page]:
        for program in (*around(text, BEFORE), text, *around(text, AFTER)):
            exec(compile(program, page, "exec", dont_inherit=True), names)


def test_there_are_blocks() -> None:
    """Fails if blocks are not found any more, or what comes before or after one belongs to none."""
    assert {page: len(texts) for page, texts in programs().items()}.items() >= {
        "docs/first_crack.md": 4, "docs/results.md": 4, "CONTRIBUTING.md": 8}.items()
    texts = [text for page in programs().values() for text in page]
    assert all(any(words in text for text in texts) for words in (*BEFORE, *AFTER))


def commands() -> list[str]:
    """Command lines of the pages, without comments and redirections, once each."""
    lines = {re.split(r"\s+#|\s+>", line)[0].strip() for page in PAGES for text in blocks(page, "bash")
             for line in text.replace("\\\n", " ").splitlines()}
    return sorted(line for line in lines if line.startswith(("skfsink ", "python -m skfsink.cases.")))


def said_of(line: str, capsys: pytest.CaptureFixture[str]) -> str:
    """The help of what a command line calls."""
    if line.startswith("skfsink "):
        status, _, said = invoke_program(shlex.split(line)[1], "--help")
        assert status == 0
        return str(said)
    case = line.split()[2].removeprefix("skfsink.cases.")
    if case == "NAME":
        case = CASES[0]
    with pytest.raises(SystemExit) as end:
        command(find_case(case).function, ["--help"])
    assert end.value.code == 0
    return capsys.readouterr().out


def deck_of(name: str) -> Deck:
    """The deck of a command: one that is shipped, or of a case for a file that pages only name."""
    path = deck_path(Path(name))
    return read_deck(path if path.is_absolute() else ROOT / path) if (ROOT / path).is_file() else Deck(
        "single_edge_notch", {})


@pytest.mark.parametrize("line", commands())
def test_commands_are_understood(line: str, capsys: pytest.CaptureFixture[str], tmp_path: Path,
                                 monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a command, or an option in it, is unknown; cheap ones if they end with an error."""
    monkeypatch.chdir(tmp_path)  # some write a picture
    words = shlex.split(line)
    if words[0] == "skfsink" and words[1] in RUN:
        status, err, out = invoke_program(*words[1:])
        assert (status, err) == (0, "") and out
        return
    help_ = said_of(line, capsys)
    for option, value in zip(words, [*words[1:], ""]):
        assert not option.startswith("--") or re.search(rf"{option}\b", help_), option
        assert option != "--vary" or read_variation(value, deck_of(words[2]))


# --- messages ---
def templates(node: ast.AST) -> Iterator[str]:
    """Texts in a piece of a program, with … for what is put in."""
    for part in ast.walk(node):
        if isinstance(part, ast.JoinedStr):
            yield "".join(value.value if isinstance(value, ast.Constant) else "…" for value in part.values)
        elif isinstance(part, ast.Constant) and isinstance(part.value, str):
            yield re.sub(r"%[.\w]*[a-z]", "…", part.value).replace("%%", "%")


def agree(row: str, text: str) -> bool:
    """Whether what a row quotes is, piece by piece, in a text."""
    pieces = [re.escape(piece.strip()) for piece in row.split("…") if piece.strip()]
    return re.search(".*".join(pieces), text) is not None


TREES = [ast.parse(path.read_text(encoding="utf-8")) for path in Path(skfsink.__file__).parent.rglob("*.py")
         if "study" not in path.parts]
QUOTED = [text for line in PAGES["docs/messages.md"].splitlines() if line.startswith("| `")
          for text in re.findall(r"`([^`]+)`", line.split("|")[1])]


def test_quoted_messages_are_those_of_the_program() -> None:
    """Fails if a row quotes a message that the program does not have any more."""
    texts = {text for tree in TREES for text in templates(tree)}
    assert len(QUOTED) > 60
    assert [row for row in QUOTED if not any(agree(row, text) for text in texts)] == []


def test_warnings_and_failures_have_a_row() -> None:
    """Fails if the program warns of something, or stops for something, that the page has no cure for."""
    found = []
    for tree in TREES:
        for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call) and node.args):
            name = getattr(call.func, "id", getattr(call.func, "attr", ""))
            if name in ("warning", "ConvergenceError", "InstabilityError"):
                found += list(templates(call.args[0]))[:1]
    missing = [text for text in found if not any(agree(row, ELSEWHERE.get(text, text)) for row in QUOTED)]
    assert len(found) > 30 and missing == []


# --- options and numbers ---
def test_defaults_in_the_table_of_options_are_those_of_the_program() -> None:
    """Fails if the table says another default than the program has."""
    defaults, found = asdict(Options()), 0
    for line in PAGES["docs/methods.md"].partition("## 7. Options")[2].partition("\n## ")[0].splitlines():
        if line.startswith("| `"):
            names, default, *_ = (cell.strip() for cell in line.strip("|").split("|"))
            for name, said in zip(re.findall(r"`(\w+)`", names), default.split(", ")):
                value = defaults.get(name)  # another table has the parameters of the samples
                if isinstance(value, bool):
                    assert said == ("on" if value else "off"), name
                elif isinstance(value, float | int):
                    assert float(said.replace("−", "-")) == value, name
                elif isinstance(value, str):
                    assert said.replace("–", "") == value, name
                found += name in defaults
    assert found > 30


def test_defaults_and_switches_in_the_table_of_deviations_are_those_of_the_program() -> None:
    """Fails if the page on the paper gives a default or a switch that no case has."""
    parameters = {name: parameter for case in CASES for name, parameter in find_case(case).parameters.items()}
    found = 0
    for line in PAGES["docs/leaving_the_paper.md"].splitlines():
        if line.startswith("| ["):
            _, _, _, default, switches, *_ = (cell.strip() for cell in line.strip("|").split("|"))
            for name, value in re.findall(r"`(\w+)` ([\w.-]+)", default):
                said = {"on": "True"}.get(value, value)
                assert said == (expected := str(parameters[name].default)) or float(said) == float(expected), name
                found += 1
            flags = {name.replace("-", "_") for name in re.findall(r"--(?:no-)?([\w-]+)", switches)}
            assert flags <= parameters.keys(), line
    assert found >= 13


def test_numbers_of_the_loading_are_those_of_the_program() -> None:
    """Fails if the page of methods gives other limits of Newton's method than the program has."""
    controls = StaticsControls()
    said = re.search(r"\*\*Limits\.\*\* (\d+) steps for each equilibrium.* at most (\d+) passes.*?; (\d+)\s+in a pass",
                     PAGES["docs/methods.md"], re.DOTALL)
    assert said and [int(n) for n in said.groups()] == [controls.max_newton, controls.max_passes, Statics.SNAP]


# --- pages ---
def test_links_hold_in_the_repository() -> None:
    """Fails if a relative link, or its heading, does not exist."""
    dead = []
    for page, text in PAGES.items():
        for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", FENCE.sub("", text)):
            name, _, anchor = target.partition("#")
            path = (ROOT / page).parent / name if name else ROOT / page
            if not path.exists() or (anchor and "." not in anchor and anchor not in headings(path)):
                dead.append(f"{page}: {target}")
    assert dead == []


def headings(path: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    found = re.findall(r"^#+ (.+)$", FENCE.sub("", path.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", text.strip().lower()).replace(" ", "-") for text in found}


@pytest.mark.slow
def test_the_page_of_scenes_is_up_to_date() -> None:
    """Fails if docs/scenes.md is not what `python docs/make/scenes.py` writes."""
    assert made("scenes").page() == PAGES["docs/scenes.md"]


def test_formulas_become_mathml() -> None:
    """Fails if bold letters are left to browsers, which ignore them, or an unknown command is shown as text."""
    pytest.importorskip("mkdocs")
    pytest.importorskip("latex2mathml")
    from mkdocs.exceptions import PluginError

    hooks = made("hooks")
    text = hooks.mathml(r"\mathbf F^T\mathcal H<\tfrac{1}{2}", False)
    assert "<mi>𝐅</mi>" in text and "<mi>ℋ</mi>" in text and "<mfrac>" in text and "&#x0003C;" in text
    with pytest.raises(PluginError, match="cannot be shown"):
        hooks.mathml(r"\nosuchcommand{x}", False)


# --- the first lines of the README ---
@pytest.mark.slow
def test_the_readme_prints_what_it_says(registries: None, pictures: None, tmp_path: Path,
                                        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails if the lines of Python in the README print something else than stands below them, or leave no picture.

    Words have to be the same, and the onset to its last digit; energies of a crack that branches to a fifth.
    """
    (program,), (said,) = blocks("README.md", "python"), blocks("README.md", "text")
    assert len(program.splitlines()) <= 10
    monkeypatch.chdir(tmp_path)
    exec(compile(program, "README.md", "exec", dont_inherit=True), {"__name__": "example"})
    printed, number = capsys.readouterr().out, re.compile(r"\d+\.?\d*")
    assert number.sub("#", printed) == number.sub("#", said)
    assert printed.splitlines()[0] == said.splitlines()[0]
    pairs = zip(number.findall(printed), number.findall(said), strict=True)
    assert all(abs(float(one) - float(other)) <= max(0.2 * float(other), 1.0 * ("." not in other))
               for one, other in pairs)
    assert (tmp_path / "plate.png").stat().st_size > 10_000
