"""The directions of fibres in a body, from the tables [[fibres]] of a deck.

    [[fibres]]
    region = "media"              # left out: what is in no region, and regions of the same law
    direction = "circumferential" # around the line through `centre` along `axis`; or "axial", along it; or [1, 1, 0]
    centre = ["0 mm", "0 mm"]
    normal = [0, 0, 1]            # of the plane of the fibres; left out: the radius, what rises, or that of the law

    [[fibres]]
    azimuth = "30 degree"         # from x towards y; elevation = "10 degree" rises from there towards z

    [[fibres]]
    array = "fibre"               # vectors of the mesh file, on its cells or points
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import ParameterError, place_text
from ..material import HolzapfelGasserOgden, Material
from ..material.oriented import AroundALine, GivenDirections, oriented
from ..material.regions import Region, rest_of
from ..meshing.sample import Sample
from .tables import read_tables

__all__ = ["directions_of", "with_fibres"]

Vector = tuple[float, float, float]


def with_fibres(tables: Any, sample: Sample, material: Material, regions: Sequence[Region], axisymmetric: bool
                ) -> tuple[Material, tuple[Region, ...]]:
    """The material of a body and its regions, with the directions of the tables.

    Those of the body are also those of regions of the same law, as of one that differs in its strength alone.

    Raises
    ------
    ParameterError
        A region is there twice, or not there, has no fibres or gets them twice; directions are missing, or there are
        none somewhere; the deck directs the fibres of some parts of the body, and nothing those of another.
    """
    found, seen = {region.name: region for region in regions}, set[str]()
    if len(found) < len(regions):
        names = [region.name for region in regions]
        raise ParameterError(f"region {next(name for name in names if names.count(name) > 1)} is there twice: leave "
                             f"one out")
    given = {table.get("region", ""): table for table in read_tables("fibres", tables)}
    alike = [name for name, region in found.items()
             if "" in given and name not in given and region.material == material]
    rest = rest_of(list(found.values()), sample.space.n_elements)
    for table in (*read_tables("fibres", tables), *({**given[""], "region": name} for name in alike)):
        name = table.get("region", "")
        if name in seen:
            raise ParameterError(f"fibres {_of(name)} are there twice: leave one out")
        seen.add(name)
        if name and name not in found:
            raise ParameterError(f"fibres: {name} is no region of the deck, which has "
                                 f"{', '.join(found) or 'none: leave region out'}")
        elements = found[name].elements if name else rest
        law = _directed(table, name, sample, found[name].material if name else material, elements, axisymmetric)
        if name:
            found[name] = replace(found[name], material=law)
        else:
            material = law
    if seen:
        for name, law in (*((("", material),) if rest.size else ()), *((r.name, r.material) for r in found.values())):
            if name not in seen and _undirected(law):
                raise ParameterError(f"fibres {_of(name)} have no direction, and would lie along x while others of the "
                                     f"deck have one: add a table [[fibres]]" + (f" with region = {name!r}" if name else
                                     " without a region") + ", or an axis in the constants")
    return material, tuple(found.values())


def _undirected(law: Material) -> bool:
    """Whether nobody has said where the fibres of a law lie."""
    default = HolzapfelGasserOgden()
    return isinstance(law, HolzapfelGasserOgden) and (law.axis, law.normal) == (default.axis, default.normal)


def _of(name: str) -> str:
    return f"of region {name}" if name else "of the body"


def _directed(table: Mapping[str, Any], name: str, sample: Sample, material: Material, elements: np.ndarray,
              axisymmetric: bool) -> Material:
    """A law with the directions of a table."""
    if not isinstance(material, HolzapfelGasserOgden):
        raise ParameterError(f"fibres {_of(name)}: {type(material).__name__} has none; take the material hgo")
    normal = None if "normal" not in table else _vector(table["normal"])
    centres = np.zeros((elements.size, 3))
    centres[:, :sample.space.dim] = sample.space.X[sample.space.conn[elements]].mean(axis=1)
    try:
        direction = table.get("direction")
        if isinstance(direction, str):
            line = AroundALine(_vector(table.get("axis", (0, 1, 0) if axisymmetric else (0, 0, 1))),
                               _vector(table.get("centre", (0, 0, 0))), along=direction == "axial")
            if not any(line.axis):
                raise ParameterError("axis must not be the zero vector")
            if (on := line.on_line(centres)).any():
                raise ParameterError(f"the element at {place_text(centres[np.argmax(on), :sample.space.dim])} mm lies "
                                     f"on the line they go around: move centre")
            law: Material = oriented(material, line, normal)
        elif "array" in table:
            law = oriented(material, GivenDirections(centres, _array(table["array"], sample, elements)), normal)
        else:
            axis, across = (_vector(direction), material.normal) if direction is not None else _from_angles(table)
            law = replace(material, axis=axis, normal=normal or across)
        assert isinstance(law, HolzapfelGasserOgden)
        law.fibres(centres[:, :sample.space.dim])
    except ParameterError as error:
        raise ParameterError(f"fibres {_of(name)}: {error}") from None
    return law


def _vector(numbers: Sequence[float]) -> Vector:
    x, y, z = [*map(float, numbers), 0.0][:3]
    return x, y, z


def _from_angles(table: Mapping[str, Any]) -> tuple[Vector, Vector]:
    """The axis, and the normal that rises with it: z where the axis lies in the plane of x and y."""
    azimuth, elevation = np.radians(table["azimuth"]), np.radians(table.get("elevation", 0.0))
    (ca, sa), (ce, se) = (map(float, (np.cos(angle), np.sin(angle))) for angle in (azimuth, elevation))
    return (ca * ce, sa * ce, se), (-ca * se, -sa * se, ce)


def _array(name: str, sample: Sample, elements: np.ndarray) -> np.ndarray:
    """Vectors of an array of the mesh file at some elements, (m, 3)."""
    if name not in sample.vectors:
        raise ParameterError(f"mesh {sample.name} has no array {name!r} of vectors; it has "
                             f"{', '.join(sample.vectors) or 'none: write them into a VTU file'}")
    values = sample.vectors[name][elements]
    if (empty := ~(np.isfinite(values).all(axis=1) & (np.linalg.norm(values, axis=1) > 0))).any():
        raise ParameterError(f"the array {name} has no direction in element {elements[np.argmax(empty)]}, and in "
                             f"{int(empty.sum())} in all")
    return values


def directions_of(parts: Sequence[Region], centres: np.ndarray) -> np.ndarray | None:
    """Directions of the fibres of all elements, (ne, families, 3), NaN where there are none; None without fibres.

    Families that run alike everywhere are one.
    """
    pairs = [(part.elements, part.material.fibres(centres[part.elements])) for part in parts
             if hasattr(part.material, "fibres")]
    most = max((fibres.shape[1] for _, fibres in pairs), default=0)
    if not most:
        return None
    found = np.full((len(centres), most, 3), np.nan)
    for elements, fibres in pairs:
        found[elements, :fibres.shape[1]] = fibres
    alike = np.abs(np.einsum("efi,ei->ef", found, found[:, 0])) > 1.0 - 1e-12
    kept = [f for f in range(most) if f == 0 or not (alike[:, f] | np.isnan(found[:, f, 0])).all()]
    return found[:, kept]
