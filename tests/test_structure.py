"""The structure of the package: imports run downwards, without circles; names in the documents are those of modules."""

from __future__ import annotations

import graphlib
import importlib
import importlib.util
import inspect
import json
import re
import subprocess
import sys
import warnings
from pathlib import Path
from types import ModuleType

import pytest

from skfsink.system.moved import OLD

ROOT = Path(__file__).resolve().parents[1]
#: modules that import others by names made at run time; docs/structure.md has the reasons
DYNAMIC = {"skfsink.__main__", "skfsink.scene.registry", "skfsink.system.moved"}
MOST_ENTRIES = 23  # at the top of the package


def _structure() -> ModuleType:
    spec = importlib.util.spec_from_file_location("structure", ROOT / "docs" / "make" / "structure.py")
    assert spec and spec.loader
    module = sys.modules["structure"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


structure = _structure()
FLOORS = structure.floors()
IMPORTS = [found for file in structure.sources() for found in structure.imports(file)]


# --- floors ---
def test_the_reader_of_imports_sees_every_kind(tmp_path: Path) -> None:
    """Fails if an import is overlooked: relative, absolute, of a module by its package, in a function, for types."""
    package = tmp_path / "skfsink"
    (package / "fem").mkdir(parents=True)
    (package / "fem" / "space.py").write_text("")
    (package / "fem" / "forms.py").write_text(
        "import numpy, skfsink.run.compute\nfrom . import space\nfrom .space import Space, Pattern\n"
        "from .. import errors as e\nfrom skfsink.scene.deck import Deck\n"
        "if TYPE_CHECKING:\n    from ..run import Run\ndef f():\n    from ..cli.program import run\n")
    (package / "errors.py").write_text("")
    found = [(one.module, one.name, one.typing) for one in structure.imports(package / "fem" / "forms.py", package)]
    assert sorted(found) == [
        ("skfsink.cli.program", "run", False), ("skfsink.errors", "", False), ("skfsink.fem.space", "", False),
        ("skfsink.fem.space", "Pattern", False), ("skfsink.fem.space", "Space", False), ("skfsink.run", "Run", True),
        ("skfsink.run.compute", "", False), ("skfsink.scene.deck", "Deck", False)]
    assert len(IMPORTS) > 800 and any(one.typing for one in IMPORTS) and any(one.module == "skfsink.errors"
                                                                             for one in IMPORTS)


def test_no_import_runs_upwards() -> None:
    """Fails if a module imports from a package on its own or a higher floor, be it in a function or for types only."""
    upwards = []
    for one in IMPORTS:
        here, there = structure.top(structure.dotted(one.file)), structure.top(one.module)
        if here not in structure.ABOVE and here != there and FLOORS.get(there, len(FLOORS)) >= FLOORS[here]:
            upwards.append(str(one))
    assert upwards == []


def test_no_circle_of_modules() -> None:
    """Fails if modules import each other in a circle, be it by an import within a function."""
    graph: dict[str, set[str]] = {}
    for one in IMPORTS:
        if not one.typing and one.file.suffix == ".py":
            graph.setdefault(structure.dotted(one.file), set()).add(one.module)
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        pytest.fail(" imports ".join(reversed(error.args[1])))


def test_names_come_from_the_modules_that_have_them() -> None:
    """Fails if a module takes a name from a package that only hands it on when asked."""
    lazy = {structure.dotted(file) for file in structure.sources() if file.name == "__init__.pyi"}
    assert len(lazy) > 8
    assert [str(one) for one in IMPORTS if one.name and one.module in lazy] == []


def test_the_top_has_what_is_declared() -> None:
    """Fails if something stands at the top of the package that has no floor, or a floor has nothing."""
    found = {path.name for path in structure.PACKAGE.iterdir() if path.name not in ("__pycache__", "data")}
    declared = {name if (structure.PACKAGE / name).is_dir() else f"{name}.py" for name in FLOORS}
    above = {f"{name}.py" for name in structure.ABOVE}
    assert found == declared | above | {"__init__.pyi"} | set(structure.OTHERS)
    assert len(found) <= MOST_ENTRIES


def test_modules_are_found_by_name_in_three_places() -> None:
    """Fails if another module imports what cannot be seen in its source."""
    found = {structure.dotted(file) for file in structure.sources() if structure.dynamic_imports(file)}
    assert found == DYNAMIC


def test_the_page_has_every_package() -> None:
    """Fails if the table in docs/structure.md misses a package, or has one that is not there."""
    rows = re.findall(r"^\| (`.*?`) \|", structure.PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(name for row in rows for name in re.findall(r"`(\w+)`", row)) == sorted(FLOORS)


def test_a_first_import_is_light() -> None:
    """Fails if `import skfsink` brings in what takes long."""
    heavy = {"numpy", "numba", "scipy", "matplotlib", "skfem", "meshio", "pint", "pyamg"}
    program = f"import sys, skfsink; dir(skfsink); print(*{heavy} & sys.modules.keys())"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout.split() == []


def test_sizes_are_printed() -> None:
    """Fails if the command of the page does not run, or leaves out a package."""
    ran = subprocess.run([sys.executable, ROOT / "docs" / "make" / "structure.py"], capture_output=True, text=True,
                         check=True)
    assert "longest function: skfsink." in ran.stdout and "most positional arguments: skfsink." in ran.stdout
    assert all(re.search(rf"^ +\d+  {name} ", ran.stdout, re.MULTILINE) for name in FLOORS)


# --- names ---
@pytest.mark.parametrize("old", OLD)
def test_old_names_of_modules(old: str) -> None:
    """Fails if a documented module is gone under its old name, comes as a copy of itself, or without a warning."""
    sys.modules.pop(f"skfsink.{old}", None)
    with pytest.warns(DeprecationWarning, match=rf"^skfsink.{old} is skfsink.{OLD[old]} now"):
        module = importlib.import_module(f"skfsink.{old}")
    assert module is importlib.import_module(f"skfsink.{OLD[old]}")
    assert module.__name__ == module.__spec__.name == f"skfsink.{OLD[old]}"  # type: ignore[union-attr]


def _documents() -> dict[str, str]:
    """Text of the pages; the changelog tells of the past."""
    pages = [*ROOT.glob("docs/**/*.md"), *ROOT.glob("cases/**/*.md"), *(ROOT / name for name in ("README.md",
                                                                                             "CONTRIBUTING.md"))]
    found = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in pages}
    for path in ROOT.glob("docs/*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        found[path.relative_to(ROOT).as_posix()] = "\n".join("".join(cell["source"]) for cell in cells)
    return found


def _names(text: str) -> set[str]:
    """Dotted names in a text; NAME stands for that of a case."""
    return {name.replace("NAME", "single_edge_notch") for name in re.findall(r"\bskfsink(?:\.[A-Za-z_]\w*)+", text)}


def _found(name: str) -> object:
    """What a dotted name stands for: a module, or what is in one."""
    words = name.split(".")
    for n in range(len(words), 0, -1):
        try:
            found: object = importlib.import_module(".".join(words[:n]))
        except ModuleNotFoundError as error:
            if not (error.name or "").startswith("skfsink"):
                raise  # a package that skfsink needs
            continue
        for word in words[n:]:
            found = getattr(found, word)
        return found
    raise ModuleNotFoundError(name)


@pytest.mark.parametrize("page", _documents())
def test_names_in_documents(page: str) -> None:
    """Fails if a page names a module, function or class of the package that is not there, or under its old name."""
    with warnings.catch_warnings(action="error", category=DeprecationWarning):
        for name in sorted(_names(_documents()[page])):
            try:
                _found(name)
            except (ImportError, AttributeError, DeprecationWarning) as error:
                pytest.fail(f"{page}: {name}: {error}")


def test_names_of_files_in_documents() -> None:
    """Fails if a page names a file of the project, `folder/file.py`, that is not there."""
    gone = [f"{page}: {path}" for page, text in _documents().items()
            for path in re.findall(r"(?<![\w/.<-])[A-Za-z_]\w*(?:/\w+)*/\w+\.py\b", text)
            if not any((base / path).is_file() for base in (ROOT, structure.PACKAGE, (ROOT / page).parent))]
    assert gone == []


def test_the_documents_name_modules() -> None:
    """Fails if the names are not found any more, and the tests above hold nothing."""
    names = set().union(*map(_names, _documents().values()))
    modules = [name for name in names if inspect.ismodule(_found(name))]
    assert len(modules) > 50 and len(names) > 60
