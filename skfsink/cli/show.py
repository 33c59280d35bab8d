"""`show`: what can be asked of a case, as a deck to start from."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator

from docstring_parser import parse

__all__ = ["deck_text", "show"]

WIDTH = 100
#: tables of a custom scene
EXAMPLES = {
    "grips": ('[[grips]]', 'boundary = "bottom"', 'x = 0', 'y = 0', '[[grips]]', 'boundary = "top"', 'x = 0',
              'y = "1e-3 mm/s"', '[[grips]]', 'boundary = "right"',
              'x = [["0 s", "0 mm"], ["10 s", "0.5 mm"]]     # then it stays'),
    "tractions": ('[[tractions]]', 'boundary = "left"', 'x = "-1 kPa/s"'),
    "regions": ('[[regions]]', 'name = "inclusion"', 'material = "neo-hookean"', 'constants = "mu = 2 MPa"',
                'phi = "1 MPa"          # also m, bulk_modulus, density'),
}


def show(case: str) -> None:
    """Print a deck of a case: every parameter with its meaning, its unit and its default.

    Parameters
    ----------
    case
        Name of the case; `skfsink list` lists them.
    """
    print(deck_text(case), end="")


def deck_text(case: str) -> str:
    """A deck with every parameter of `case` at its default, each below a comment."""
    return "\n".join(_lines(case)) + "\n"


def _lines(case: str) -> Iterator[str]:
    from ..scene.options import Options
    from ..scene.registry import case_function, parameters_of
    from ..scene.tables import TABLES
    from ..units import UNITS

    function = case_function(case)
    own = parse(function.__doc__ or "")
    meaning = {p.arg_name: p.description or "" for p in (*parse(Options.__doc__ or "").params, *own.params)}
    yield from _comment(f"{own.short_description} {own.long_description or ''}")
    yield "# Plain numbers are in N, mm, MPa and s, the density in kg/m^3; a parameter left out has its default."
    yield f'case = "{case}"'
    yield ""
    yield "[parameters]"
    parameters = parameters_of(case)
    for name, default in sorted(parameters.items(), key=lambda item: item[0] in TABLES):  # tables come last
        yield ""
        yield from _comment(meaning[name])
        if name in TABLES:
            yield from (f"# {line}" for line in EXAMPLES[name])
            continue
        unit = UNITS.get(name)
        yield f"{name} = " + json.dumps(f"{default!r} {unit}" if unit else default)


def _comment(text: str) -> list[str]:
    return textwrap.wrap(" ".join(text.split()), WIDTH, initial_indent="# ", subsequent_indent="# ")
