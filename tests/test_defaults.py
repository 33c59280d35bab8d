"""Defaults: each stands once in the program, and the documents say the same."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.material import AAA, LIMITERS, MATERIALS, NeoHookean, SinkLaw
from skfsink.methods.controls import ExplicitControls, HHTControls, StaticsControls
from skfsink.scene.case import shared_parameters
from skfsink.scene.controls import Controls
from skfsink.scene.options import OUTSIDE_A_DECK, Options
from skfsink.scene.registry import CASES, find_case

DOCS = Path(__file__).resolve().parents[1] / "docs"
METHODS = (DOCS / "methods.md").read_text(encoding="utf-8")


def rows(page: str, head: str) -> list[list[str]]:
    """Cells of the rows of the table of a page that has this head."""
    lines = page[page.index(head):].splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split(" | ")]
            for line in lines[:next(i for i, line in enumerate(lines) if not line.startswith("|"))]]


def value(cell: str) -> Any:
    """What a cell says: a number, a word, on or off, nothing."""
    words = {"off": False, "on": True, "–": ""}
    power = re.match(r"\$10\^\{(-?\d+)\}\$", cell)
    if power:
        return float(f"1e{power[1]}")
    try:
        return float(cell.replace("−", "-"))
    except ValueError:
        return words.get(cell, cell)


def named(cell: str, other: str) -> Iterator[tuple[str, Any]]:
    """Names and values of a row, of which there may be several with commas."""
    if names := re.findall(r"`(\w+)`", cell):
        yield from zip(names, map(value, other.split(", ") if len(names) > 1 else [other]), strict=True)


def test_the_table_of_options_has_every_option_and_its_default() -> None:
    """Fails if docs/methods.md leaves an option out, has one that is none, or says another default."""
    said = dict(pair for row in rows(METHODS, "| option | default |") for pair in named(row[0], row[1]))
    assert said.keys() == {*shared_parameters(), "out", "resume", "overwrite", "quiet", "partition", "frame_pieces"}
    for name, default in said.items():
        if name not in ("out", "resume", "partition"):
            assert default == getattr(Options, name), name
    assert {f.name for f in fields(Options)} - said.keys() < {*OUTSIDE_A_DECK}


def test_the_table_of_floors() -> None:
    """Fails if a floor in docs/methods.md is not the one that is used."""
    said = dict(pair for row in rows(METHODS, "| floor | acts on |") for pair in named(row[0], row[2].split(" of ")[0]))
    assert said == {name: getattr(Options, name) for name in ("force_floor", "mass_floor", "deletion")}
    assert value(next(row[2] for row in rows(METHODS, "| floor |") if "varepsilon" in row[0])) == SinkLaw.epsilon


def test_the_table_of_the_cases() -> None:
    """Fails if a dimension of a sample is left out of docs/methods.md, or has another default there."""
    table = {row[0].strip("`"): row[1] for row in rows(METHODS, "| case | dimensions |")}
    assert {*table, "custom"} == {*CASES}
    for name, cell in table.items():
        said = {key: float(number) for key, number in re.findall(r"`(\w+)` ([\d.]+)", cell)}
        assert said == {p.name: p.default for p in find_case(name).arguments
                        if p.kind in (int, float) and p.name != "mesh_seed"}, name


def test_the_table_of_the_materials() -> None:
    """Fails if docs/materials.md has another default of a constant or another limiter than the library."""
    page = (DOCS / "materials.md").read_text(encoding="utf-8")
    table = rows(page, "| name | $\\psi$ |")
    assert [row[0].strip("`") for row in table] == [*MATERIALS]
    for row in table:
        kind = MATERIALS[row[0].strip("`")]
        listed = re.findall(r"`(\w+)`(?: \([^)]*\))? ([\d.]*\d(?:, −?[\d.]*\d)*)", row[-1])
        said = {name: [float(number.replace("−", "-")) for number in numbers.split(", ")] for name, numbers in listed}
        own = [f for f in fields(kind) if f.name not in ("bulk_modulus", "density", "viscosity", "axis", "normal")]
        assert said == {f.name: list(f.default) if isinstance(f.default, tuple) else [f.default] for f in own}, row[0]
    for row in rows(page, "| name | the constants are those of |"):
        assert float(row[2].split(",")[0]) == LIMITERS[row[0].strip("`")].phi, row[0]
        assert f"$m$ = {LIMITERS[row[0].strip('`')].m:g}" in page
    basis = re.search(r"`bulk_modulus` \((\d+) MPa\) and `density` \((\d+) kg", page)
    assert basis is not None
    for kind in MATERIALS.values():
        assert (float(basis[1]), float(basis[2])) == (kind.bulk_modulus, kind.density)


def test_options_are_those_of_the_laws_and_controls() -> None:
    """Fails if options that nobody changed compute otherwise than the laws and controls that nobody changed."""
    options = Options()
    assert options.controls() == Controls()
    assert f"(aaa: {SinkLaw.phi})" in shared_parameters()["phi"].meaning and f"(aaa: {SinkLaw.phi})" in METHODS
    assert options.sink_law() == SinkLaw() and options.stored_energy() == AAA()
    assert NeoHookean().shear_modulus == AAA().shear_modulus


@pytest.mark.parametrize(("kind", "option_of"), [
    (ExplicitControls, {}), (HHTControls, {"alpha": "hht_alpha", "dt": "hht_dt"}), (StaticsControls, {}),
    (Controls, {}), (SinkLaw, {}), (AAA, {})])
def test_options_reach_what_they_are_named_after(kind: Any, option_of: dict[str, str]) -> None:
    """Fails if an option is not handed to the control or the law that has it, or two options change places."""
    changed = Options(
        courant=0.5, gamma_every=3, energy_tolerance=1e-4, mass_floor=0.01, hht_alpha=-0.1, hht_dt=1e-7,
            coupling="single", mass="consistent",
        front=0.7, analysis="both", integrator="hht", sink="nearest", element="plain", overshoot=0.01, deletion=1e-5,
        force_floor=0.01, event_time=1e-4, aftermath=2e-5, record_every=2e-6, frame_every=3e-6, balance_tolerance=0.1,
        checkpoint_every=10.0, threads=2, active_zone=False, phi=0.2, m=8.0, length_scale=0.2, c1=0.5, c2=1.0,
        bulk_modulus=400.0, density=1000.0, kernels="forms", gradient="gauss", density_solver="jacobi",
        linear="multigrid", viscosity=1e-5, bulk_viscosity_linear=0.06, bulk_viscosity_quadratic=1.2, raised_mass=0.0,
        subcycled=0.001, fields="W", pictures="svg", series="vtkhdf", stop="arrival")
    controls = changed.controls()
    made = {ExplicitControls: controls.explicit, HHTControls: controls.hht, StaticsControls: controls.statics,
            Controls: controls, SinkLaw: changed.sink_law(), AAA: changed.stored_energy()}[kind]
    same = [f.name for f in fields(kind) if option_of.get(f.name, f.name) in shared_parameters()
            and (kind, f.name) not in {(StaticsControls, "tolerance")}]  # the option is that of a model
    assert same
    for name in same:
        option = option_of.get(name, name)
        assert getattr(made, name) == getattr(changed, option), name
        same_here = option in ("phi", "start", "contact", "debris")
        assert same_here or getattr(changed, option) != getattr(Options, option), option


def test_what_fields_take_by_themselves() -> None:
    """Fails if the fields, made without a scene, have other defaults than those of a scene."""
    momentum, density = inspect.signature(Momentum).parameters, inspect.signature(DensitySolver).parameters
    assert momentum["element"].default == Controls.element
    assert momentum["force_floor"].default == Controls.force_floor
    assert density["sink"].default == Controls.sink and density["active_zone"].default == Controls.active_zone
    assert density["gradient"].default == Controls.gradient
