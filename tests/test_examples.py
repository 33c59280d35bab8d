"""The examples: each runs and holds its number; its page and its picture are those of the script."""

from __future__ import annotations

import importlib.util
import runpy
import sys
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
FAST = ("rubber_sheet", "own_material")  # seconds, where the loops are compiled
NEEDS = {"own_sample": "gmsh", "ensemble_on_dask": "distributed"}


def loaded(path: Path) -> ModuleType:
    """A script as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


GALLERY, MAKE = loaded(ROOT / "examples" / "make_gallery.py"), loaded(ROOT / "docs" / "make" / "gallery.py")
NAMES: list[str] = GALLERY.names()


@pytest.mark.parametrize("name", [name if name in FAST else pytest.param(name, marks=pytest.mark.slow)
                                  for name in NAMES])
def test_an_example_runs_and_holds_its_number(name: str, pictures: None, tmp_path: Path,
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a script ends with an error, its number is off, or it leaves no picture."""
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
    assert Image.open(tmp_path / f"{name}.png").format == "PNG"
    pyplot.close("all")


def test_an_example_without_its_extra_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the example on Dask is a traceback where there is no Dask."""
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit, match=r"this example needs Dask: pip install 'skfsink\[sweep\]'"):
        runpy.run_path(str(ROOT / "examples" / "ensemble_on_dask.py"), run_name="__main__")


@pytest.mark.parametrize("name", NAMES)
def test_an_example_is_short(name: str) -> None:
    """Fails if a script has 40 lines of code or more, no number that it holds, or says nothing of it."""
    text = (ROOT / "examples" / f"{name}.py").read_text(encoding="utf-8")
    _, said, code = text.split('"""', 2) if text.startswith('"""') else ("", "", text)
    assert len(code.strip().splitlines()) < 40 and "assert " in code and "The number: " in " ".join(said.split())
    assert max(map(len, text.splitlines())) <= 120


def test_the_gallery_is_in_step() -> None:
    """Fails if a page is not what `python docs/make/gallery.py` writes, or a script lacks its page or picture."""
    pages = MAKE.pages()
    assert sorted(MAKE.NAMES) == NAMES
    assert [path for path, text in pages.items() if (ROOT / "docs" / path).read_text(encoding="utf-8") != text] == []
    assert sorted(path.stem for path in (ROOT / "docs" / "examples").glob("*.md")) == NAMES
    assert sorted(path.stem for path in GALLERY.PICTURES.glob("*.png")) == NAMES
    nav = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert all(f"examples/{name}.md" in nav for name in NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_picture_is_that_of_its_script(name: str) -> None:
    """Fails if a script has changed since `python examples/make_gallery.py` made its picture, or that is large."""
    path = GALLERY.PICTURES / f"{name}.png"
    assert Image.open(path).info["script"] == GALLERY.script_hash(name) and path.stat().st_size <= GALLERY.LARGEST
