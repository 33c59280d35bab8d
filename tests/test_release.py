"""What a release consists of: one version everywhere, a recipe for conda, a software paper, a page of moved names."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

import skfsink
from skfsink.system.moved import OLD

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONDA = {"matplotlib": "matplotlib-base"}  # names that conda-forge has otherwise
LIMITED = {"pypardiso"}                    # not for all machines, and so no requirement of a noarch package


def recipe() -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load((ROOT / "recipe" / "meta.yaml").read_text(encoding="utf-8"))
    return found


def test_one_version() -> None:
    """Fails if program, citation and recipe give different versions, or the changelog has no entry for a release."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == recipe()["package"]["version"] == skfsink.__version__
    assert f"## [{skfsink.__version__}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_recipe_is_one() -> None:
    """Fails if the recipe has a part or a requirement that conda-build does not know."""
    schema = yaml.safe_load((ROOT / "tests" / "data" / "conda_recipe.schema.json").read_text(encoding="utf-8"))
    jsonschema.validate(recipe(), schema)
    for wrong in ({"requirement": {}}, {"package": {"name": "skfsink", "version": "0.2.dev"}}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(recipe() | wrong, schema)


def test_requirements_of_the_recipe_are_those_of_the_project() -> None:
    """Fails if a requirement, or its least version, is changed in one place alone."""
    def parted(text: str) -> tuple[str, str]:
        found = re.fullmatch(r"([\w.-]+?)\s*((?:[<>=!~].*)?)", text.partition(";")[0].strip())
        assert found
        return CONDA.get(found[1], found[1]), found[2]

    wanted = {parted(text) for text in (*PROJECT["dependencies"], f"python{PROJECT['requires-python']}")}
    found = {parted(text) for text in recipe()["requirements"]["run"]}
    assert found == {pair for pair in wanted if pair[0] not in LIMITED}
    assert {parted(text)[0] for text in recipe()["requirements"]["run_constrained"]} == LIMITED
    (name, target), = PROJECT["scripts"].items()
    assert recipe()["build"]["entry_points"] == [f"{name} = {target}"]


def test_the_paper_cites_what_it_lists_and_shows_what_there_is() -> None:
    """Fails if a reference or a figure of the software paper is missing, or listed for nothing."""
    text = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^@\w+\{([^,]+),", (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8"), re.M))
    assert set(re.findall(r"\[@([\w-]+)\]", text)) == listed
    figures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text)
    assert figures and all((ROOT / "paper" / name).is_file() for name in figures)
    for heading in ("Summary", "Statement of need", "State of the field", "Software design", "References"):
        assert f"\n# {heading}\n" in text


def test_every_old_module_is_on_the_page() -> None:
    """Fails if the page of moved names leaves one out, or has one that does not exist."""
    text = (ROOT / "docs" / "migrating.md").read_text(encoding="utf-8")
    assert dict(re.findall(r"\| `([\w.]+)` \| `skfsink\.([\w.]+)` \|", text)) == OLD


def test_the_slim_environment_leaves_out_mkl_alone() -> None:
    """Fails if what is installed without MKL is not what the project needs else."""
    lines = [line for line in (ROOT / "recipe" / "slim.txt").read_text(encoding="utf-8").splitlines() if line[0] != "#"]
    assert lines == [text for text in PROJECT["dependencies"] if re.split(r"\W", text)[0] not in LIMITED]
