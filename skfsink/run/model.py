"""The ladder of models of each scene, and the choice of a level from what it was measured to cost and to miss.

A level is a set of option values with a name: what is analysed (`onset`: statics up to the onset, `statics`: a
quasi-static crack, `dynamics`: statics to the onset and a dynamic event, `full`: dynamics from the unloaded body on),
and what stands for the body (`half`, `slab`, `plane-stress`), for the mesh (`uniform`, `two-pass`) and for the density
solve (`everywhere`). `python -m skfsink.study.ladder` runs the levels and keeps, for each, the figures of
:mod:`.quantities` and the wall time in `cases/<case>/ladder.json`. Errors are relative to the reference level.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from ..errors import OutputError, ParameterError
from ..meshing.gmsh_model import has_gmsh
from ..scene.case import Case
from ..scene.options import Options
from ..system.shipped import data_folder
from .quantities import PATH, relative_error

__all__ = ["AUTO", "LADDERS", "REFERENCE", "SCATTER", "Ladder", "choose_model", "ladder_path", "level"]

AUTO, REFERENCE = "auto", "full"
SCATTER = "dynamics, another mesh"  # in the file of a ladder, but no level
RULED: dict[str, Any] = {"analysis": "dynamic", "integrator": "explicit", "start": "onset", "half": False,
                         "dimensions": 0, "mesh_layout": "corridor", "active_zone": True}
ANALYSES: dict[str, tuple[dict[str, Any], str]] = {
    "onset": ({"event_time": 1e-9}, "statics up to the onset"),
    "statics": ({"analysis": "quasistatic"}, "statics only"),
    "dynamics": ({}, "statics, then dynamics"),
    "full": ({"start": "rest"}, "dynamics from the unloaded body on"),
}
VARIANTS: dict[str, tuple[dict[str, Any], str]] = {
    "half": ({"half": True}, "half of the body"),
    "slab": ({"dimensions": 3}, "in three dimensions"),
    "plane-stress": ({"element": "planestress"}, "plane stress"),
    "uniform": ({"mesh_layout": "uniform"}, "uniform fine mesh"),
    "two-pass": ({"mesh_layout": "two-pass"}, "two-pass corridor"),
    "everywhere": ({"active_zone": False}, "γ everywhere"),
}
_COMMON = ("onset", "statics", "dynamics", "full", "dynamics-everywhere", "dynamics-uniform", "statics-two-pass",
           "dynamics-two-pass")
_HALVES = ("onset-half", "statics-half", "dynamics-half", "dynamics-half-two-pass")
_SHEETS = ("onset-plane-stress", "statics-plane-stress", "dynamics-plane-stress", "dynamics-half-plane-stress")
#: names of the levels of each case
LADDERS: dict[str, tuple[str, ...]] = {
    "single_edge_notch": (*_COMMON, *_HALVES, "dynamics-slab"),
    "simple_shear": (*_COMMON, "dynamics-slab"),
    "symmetric_double_edge_notch": (*_COMMON, *_HALVES, "dynamics-slab"),
    "asymmetric_double_edge_notch": (*_COMMON, "dynamics-slab"),
    "dog_bone": (*_COMMON, *_HALVES, *_SHEETS),
    "cylindrical_shell": (*_COMMON, *_HALVES),
}


@dataclass(frozen=True)
class Level:
    """A model: its name, what it is in words, and the options it sets."""

    name: str
    title: str
    options: Mapping[str, Any]

    def apply(self, options: Options) -> Options:
        """The options with those of the level.

        Raises
        ------
        ParameterError
            One of them was given as well, with another value.
        """
        defaults = Options()
        values = {**RULED, **self.options}
        for name, value in values.items():
            asked = getattr(options, name)
            if asked != value and (name in options.given_names or asked != getattr(defaults, name)):
                raise ParameterError(f"{name} = {asked} is not that of the model {self.name} "
                                     f"({value}); give the one or the other")
        return replace(options, **values, model=self.name)


def level(case: str, name: str) -> Level:
    """The level of a case by name; ParameterError says which there are."""
    if name not in LADDERS[case]:
        raise ParameterError(f"model must be {AUTO} or one of {', '.join(LADDERS[case])}; got {name!r}")
    base, _, rest = name.partition("-")
    parts = [ANALYSES[base]]
    for word, part in VARIANTS.items():  # in order, so that each combination has one name
        if f"-{word}-" in f"-{rest}-":
            parts.append(part)
    values = {key: value for part in parts for key, value in part[0].items()}
    return Level(name, "; ".join(part[1] for part in parts), values)


def ladder_path(case: str) -> Path:
    """File with the measured ladder of a case."""
    return data_folder(case) / "ladder.json"


class Ladder:
    """The measured ladder of a case, in the file that is committed or another one.

    Attributes
    ----------
    points: by level, with `quantities`, `crack`, `price_s`, or `failed`.   mesh: that it was measured on.
    processor: of the machine it was measured on.

    Raises
    ------
    OutputError
        There is none, or it cannot be read.
    """

    def __init__(self, case: str, path: Path | None = None) -> None:
        self.case, path = case, path or ladder_path(case)
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            points: dict[str, dict[str, Any]] = data["points"]
            self.points = {name: point for name, point in points.items() if name in LADDERS[case]}
            self._other_mesh = points.get(SCATTER, {})
            self.processor = str(data["machine"]["processor"])
            self.mesh = str(self.points[REFERENCE]["mesh"])
        except FileNotFoundError:
            raise OutputError(f"the models of {case} were not measured: there is no {path}; python -m "
                              f"skfsink.study.ladder {case} makes it") from None
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise OutputError(f"{path} is no measured ladder: {error}") from None

    def error(self, name: str, quantity: str) -> float | None:
        """Relative error of a level; None if it gives no such quantity, or failed."""
        value, reference = (self._value(self.points.get(key, {}), quantity) for key in (name, REFERENCE))
        return relative_error(quantity, value, reference)

    def scatter(self, quantity: str) -> float | None:
        """Relative difference between two meshes of the same sizes, of statics then dynamics; None if not measured."""
        one, other = self._value(self.points.get("dynamics", {}), quantity), self._value(self._other_mesh, quantity)
        return relative_error(quantity, other, one)

    @staticmethod
    def _value(point: Mapping[str, Any], quantity: str) -> Any:
        return point.get("crack") if quantity == PATH else point.get("quantities", {}).get(quantity)

    def by_price(self) -> list[str]:
        """Names of the levels that did not fail, the cheapest first."""
        return sorted((k for k, p in self.points.items() if "failed" not in p), key=lambda k: self.points[k]["price_s"])

    def cheapest(self, quantity: str, tolerance: float, gmsh: bool) -> tuple[str, str, str]:
        """The cheapest level within `tolerance`, the next cheaper one, and why that was refused ("" if there is none).

        Raises
        ------
        ParameterError
            The reference itself does not give the quantity.
        """
        cheaper, why = "", ""
        for name in self.by_price():
            error = self.error(name, quantity)
            if error is None:
                cheaper, why = name, f"gives no {quantity}"
            elif error > tolerance:
                cheaper, why = name, f"off by {error:.1%}"
            elif not gmsh and self.points[name].get("made"):
                cheaper, why = name, "its mesh is made by gmsh, which is not installed"
            else:
                return name, cheaper, why
        raise ParameterError(f"no model of {self.case} was measured to give {quantity} within {tolerance:.1%}")


def choose_model(case: Case, arguments: Mapping[str, Any], options: Options) -> tuple[Options, dict[str, Any]]:
    """The options of the model asked for, and how it was chosen: what is printed (`text`) and stored.

    `arguments` are those of the case function.

    Raises
    ------
    ParameterError
        An unknown model, an option against it, or nothing within the tolerance.
    OutputError
        "auto", and the models of the case were not measured.
    """
    name, cheaper, why = options.model, "", ""
    ladder = Ladder(case.name) if options.model == AUTO or ladder_path(case.name).is_file() else None
    if options.model == AUTO:
        assert ladder is not None
        name, cheaper, why = ladder.cheapest(options.quantity, options.tolerance, has_gmsh())
    model = level(case.name, name)
    model_choice: dict[str, Any] = {"model": name, "asked": options.model, "title": model.title,
                                    "quantity": options.quantity}
    text = [f"model {name} ({model.title})"]
    if options.model == AUTO:
        model_choice["tolerance"] = options.tolerance
    if ladder is not None and name in ladder.points and "failed" not in ladder.points[name]:
        error, price = ladder.error(name, options.quantity), ladder.points[name]["price_s"]
        model_choice |= {"price_s": price, "reference": REFERENCE, "measured_on": ladder.mesh,
                         "processor": ladder.processor}
        if error is not None:
            model_choice["error"] = error
        accuracy = f"{options.quantity} off by {error:.1%}" if error is not None else f"gives no {options.quantity}"
        within = f" (tolerance {options.tolerance:.1%})" if options.model == AUTO else ""
        text.append(f"{accuracy}{within} of the reference {REFERENCE}, {price:.1f} s, measured on mesh {ladder.mesh}")
    if ladder is not None and cheaper:
        price = ladder.points[cheaper]["price_s"]
        model_choice["cheaper"] = {"model": cheaper, "price_s": price, "refused": why}
        text.append(f"next cheaper: {cheaper}, {price:.1f} s, refused: {why}")
    if changed := _changed(case, arguments, options, ladder.mesh if ladder else ""):
        model_choice["changed"] = changed
        text.append(f"measured at default parameters; here {', '.join(changed)} differ{'s' * (len(changed) == 1)}")
    model_choice["text"] = "; ".join(text)
    return model.apply(options), model_choice


def _changed(case: Case, arguments: Mapping[str, Any], options: Options, mesh: str) -> list[str]:
    """Names of the parameters that are not those the ladder was measured with."""
    plain, defaults = Options(), case.default_arguments
    changed = [name for name, value in arguments.items() if name != "mesh" and value != defaults[name]]
    changed += [f.name for f in fields(Options) if f.name in plain.parameters() and f.name not in RULED
                and getattr(options, f.name) != getattr(plain, f.name)]
    if mesh and arguments["mesh"] != mesh:
        changed.append(f"mesh ({arguments['mesh']})")
    return changed

