"""Cases by name: one file is a case, its annotations are the units, and every part of the program finds it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from plates import plate

from skfsink.errors import ParameterError
from skfsink.meshing.vtu import write_mesh
from skfsink.scene.registry import CASES, find_case

ROOT = Path(__file__).resolve().parents[1]
#: the program, with a case in a folder of its own, and the data of that in another
PROGRAM = """
import sys
from pathlib import Path
import skfsink.cases
skfsink.cases.__path__.append(sys.argv[1])
import skfsink.pictures.of_a_run
import skfsink.run.compute
from skfsink.system import shipped
shipped.data_roots = lambda: (Path(sys.argv[1]),)
skfsink.run.compute.draw_run = lambda *_: None
from skfsink.scene.registry import find_case, read_scene
from skfsink.scene.deck import Deck, read_deck
from skfsink.cli.cases import list_cases
from skfsink.cli.show import deck_text
from skfsink.report.scenes import command_line, meanings
from skfsink.results.loader import load
from skfsink.sweep.vary import read_variation

case, folder = find_case("double_edge_notch"), Path(sys.argv[1])
list_cases()
print(deck_text(case.name))
found = read_variation("shear=1 um/s..2 um/s:2", Deck(case.name, {}))
assert (found.name, found.values) == ("shear", [1e-3, 2e-3])
(folder / "deck.toml").write_text('case = "double_edge_notch"\\n[parameters]\\nmesh = "coarse"\\nshear = "1 um/s"\\n'
                                  'length_scale = 0.9\\nevent_time = "1 us"\\n')
result = read_deck(folder / "deck.toml").run(out=folder / "run", quiet=True)
assert result.scene.grips[0].velocity == (1e-3, 1e-3) == read_scene(folder / "run").grips[0].velocity
assert load(folder / "run").parameters["shear"] == 1e-3 and "Speed of the upper grip" in meanings(case.name)["shear"]
print(command_line(load(folder / "run")))
"""


@pytest.mark.slow
def test_a_case_is_one_file(tmp_path: Path) -> None:
    """Fails if the case of CONTRIBUTING.md has to be named anywhere to be listed, shown, swept, run and reported."""
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (code,) = [text for text in re.findall(r"(?ms)^```python\n(.*?)^```", page) if "CASE = " in text]
    (tmp_path / "double_edge_notch" / "meshes").mkdir(parents=True)
    (tmp_path / "double_edge_notch.py").write_text(code)
    write_mesh(tmp_path / "double_edge_notch" / "meshes" / "coarse.vtu", plate(9))
    ran = subprocess.run([sys.executable, "-c", PROGRAM, str(tmp_path)], capture_output=True, text=True, check=False,
                         env={**os.environ, "COLUMNS": "200"})
    assert ran.returncode == 0, ran.stderr
    assert re.search(r"double_edge_notch +Pull a square plate with two edge notches apart\. +coarse", ran.stdout)
    assert re.search(r'(?m)^# Speed of the upper grip.*\nshear = "0.0 mm/s"$', ran.stdout)
    assert "python -m skfsink.cases.double_edge_notch --shear 0.001 --mesh coarse" in ran.stdout
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["case"] == "double_edge_notch"


@pytest.mark.parametrize("name", CASES)
def test_what_is_known_of_a_case(name: str) -> None:
    """Fails if a parameter has no meaning, no type that a deck can have, or a unit that is no unit of a number."""
    case = find_case(name)
    assert case.name == name and case.summary.endswith(".")
    assert bool(case.meshes) == (name != "custom")
    for parameter in case.parameters.values():
        assert parameter.meaning, parameter.name
        assert parameter.has_tables or parameter.kind in (int, float, str, bool), parameter.name
        assert not parameter.unit or parameter.kind is float, parameter.name
        assert parameter.shared != (parameter in case.arguments)
    assert {"mesh"} <= {parameter.name for parameter in case.arguments}


def test_there_is_no_other_case() -> None:
    """Fails if a name that is no case is imported."""
    for name in ("double_edge_notch", "../cases", "", "__init__"):
        with pytest.raises(ParameterError, match="case must be one of asymmetric_double_edge_notch, custom, "):
            find_case(name)
