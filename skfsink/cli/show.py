"""`show`: what can be asked of a case, as a deck to start from."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator
from math import inf

__all__ = ["deck_text", "show"]

WIDTH = 100
#: tables of a custom scene
EXAMPLES = {
    "grips": ('[[grips]]', 'boundary = "bottom"', 'x = 0', 'y = 0', '[[grips]]', 'boundary = "top"', 'x = 0',
              'y = "1e-3 mm/s"', '[[grips]]', 'boundary = "right"',
              'x = [["0 s", "0 mm"], ["10 s", "0.5 mm"]]     # then it stays'),
    "tractions": ('[[tractions]]', 'boundary = "left"', 'x = "-1 kPa/s"'),
    "pressures": ('[[pressures]]', 'boundary = "inner"', 'value = "16 kPa"        # or a ramp; or rate = "1 kPa/s"',
                  'in_crack = true         # in cracks that come from it as well'),
    "fillings": ('[[fillings]]', 'boundary = "inner"', 'inflow = "1 mm^3/s"     # or a ramp of the volume',
                 'compliance = "0.1 mm^3/kPa"'),
    "body_forces": ('[[body_forces]]', 'y = [["0 s", "0 m/s^2"], ["1 s", "-9.81 m/s^2"]]'),
    "velocities": ('[[velocities]]', 'region = "ball"         # left out: the body', 'x = "2 m/s"'),
    "fibres": ('[[fibres]]', 'direction = "circumferential"   # or "axial", a vector; or array = "vectors"',
               'normal = [0, 0, 1]', 'region = "adventitia"     # left out: what is in no region, or of the same law'),
    "regions": ('[[regions]]', 'name = "inclusion"', 'material = "neo-hookean"', 'constants = "mu = 2 MPa"',
                'phi = "1 MPa"          # also m, bulk_modulus, density'),
    "cracks": ('[[cracks]]', 'name = "slit"',
               'points = [["0 mm", "2 mm"], ["1 mm", "2 mm"]]   # or elements = "a set"',
               'lips = "broken"         # as of a crack that has run, or "whole" as of a cut',
               'width = "0.1 mm"        # left out: as narrow as the mesh allows',
               'length = "1 mm"         # of a line, from its first point; left out: to its last'),
    "probes": ('[[probes]]', 'name = "tip"', 'kind = "point"          # line, mean, reaction, volume, opening,',
               '                        # release_rate',
               'position = ["1 mm", "2 mm"]', 'quantity = "stress, gamma"', '[[probes]]', 'name = "forces"',
               'kind = "reaction"       # on all grips', 'every = "1 us"'),
}


def show(case: str) -> None:
    """Print a deck: of a case every parameter with its meaning, its unit and its default, or a deck as it comes.

    Parameters
    ----------
    case
        Name of the case or the deck; `skfsink list` lists them.
    """
    from ..errors import ParameterError
    from ..scene.registry import CASES
    from ..system.shipped import shipped_decks

    decks = {name: path for name, path in shipped_decks().items() if name not in CASES}
    if case not in (*CASES, *decks):
        raise ParameterError(f"case must be one of {', '.join(CASES)}, or a deck, one of {', '.join(decks)}; got "
                             f"{case!r}")
    print(decks[case].read_text(encoding="utf-8") if case in decks else deck_text(case), end="")


def deck_text(case: str) -> str:
    """A deck with every parameter of `case` at its default, each below a comment."""
    return "\n".join(_lines(case)) + "\n"


def _lines(name: str) -> Iterator[str]:
    from ..scene.registry import find_case

    case = find_case(name)
    yield from _comment(case.description)
    yield "# Plain numbers are in N, mm, MPa and s, the density in kg/m^3; a parameter left out has its default."
    yield f'case = "{name}"'
    yield ""
    yield "[parameters]"
    for parameter in sorted(case.parameters.values(), key=lambda parameter: parameter.has_tables):  # tables come last
        if parameter.name in case.refused:
            continue
        yield ""
        yield from _comment(parameter.meaning)
        if parameter.has_tables:
            yield from (f"# {line}" for line in EXAMPLES[parameter.name])
            continue
        if parameter.default == inf:  # which has no unit, and another name in JSON
            yield f"{parameter.name} = inf"
            continue
        default = f"{parameter.default!r} {parameter.unit}" if parameter.unit else parameter.default
        yield f"{parameter.name} = {json.dumps(default)}"


def _comment(text: str) -> list[str]:
    return textwrap.wrap(" ".join(text.split()), WIDTH, initial_indent="# ", subsequent_indent="# ")
