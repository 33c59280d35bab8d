"""`material`: a law of the library, its strength in homogeneous deformations, and their picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

    from ..material.homogeneous import Peak

__all__ = ["material"]

PICTURES = (".png", ".pdf", ".svg")


def material(name: str, /, *, phi: float | None = None, m: float | None = None, out: Path | None = None,
             **constants: str) -> None:
    """Print where a material fails in homogeneous deformations, and draw its stress against stretch.

    Parameters
    ----------
    name
        aaa, neo-hookean, yeoh, mooney-rivlin, gent, arruda-boyce, ogden, or hgo.
    phi
        Energy limiter Phi [MPa]; by default the one that goes with the material's default constants.
    m
        Sharpness of the limiter.
    out
        Picture to write: a .png, .pdf or .svg file.
    constants
        Constants of the law by name, such as --mu 0.3 or --mu "300 kPa", or --E 0.9 --nu 0.499; vectors as --axis
        1,0,0, or --mu 0.63,0.0012 --alpha 1.3,5. A plain number is in the unit of the constant, MPa. An unknown one
        lists those there are.
    """
    from dataclasses import fields

    from docstring_parser import parse
    from rich.console import Console

    from ..errors import ParameterError
    from ..material import MATERIALS, MODULI, SinkLaw, limiter_of, material_from, read_constants
    from ..material.homogeneous import peaks

    if out is not None and out.suffix not in PICTURES:
        raise ParameterError(f"out must be a file ending in {', '.join(PICTURES)}; got {str(out)!r}")
    found: dict[str, Any] = {key.replace("-", "_"): text for key, text in constants.items()}
    if name in MATERIALS and set(MODULI) & found.keys():
        beside = {key: found.pop(key) for key in ("density", *("bulk_modulus",) * ("nu" not in found)) if key in found}
        if "bulk_modulus" in found:
            raise ParameterError("bulk_modulus and nu say the same: give one of them")
        found = {**beside, **read_constants(name, ", ".join(f"{key} = {text}" for key, text in found.items()))}
    chosen = material_from(name, {key: _value(key, text) for key, text in found.items()})
    limiter = limiter_of(name)
    law = SinkLaw(phi=limiter.phi if phi is None else phi, m=limiter.m if m is None else m)
    strengths = peaks(chosen, law)
    console = Console(highlight=False)
    console.print(f"[bold]{name}[/bold]  {parse(type(chosen).__doc__ or '').short_description}", markup=True)
    console.print("constants       " + ", ".join(f"{f.name} {_text(getattr(chosen, f.name))}" for f in fields(chosen)))
    console.print(f"sink            phi {law.phi:g} MPa, m {law.m:g}" + (f" ({limiter.source})" if phi is None else ""))
    console.print(f"failure energy  {law.failure_energy:.4g} MPa")
    console.print(f"shear modulus   {chosen.shear_modulus:.4g} MPa; c_s {chosen.shear_wave_speed:.4g} m/s, "
                  f"c_R {chosen.rayleigh_wave_speed:.4g} m/s")
    console.print(_table(law.phi, strengths))
    if out is not None:
        from ..pictures.stress_curves import stress_picture

        stress_picture(chosen, law, strengths, out, rf"{name}, $\Phi$ = {law.phi:g} MPa, $m$ = {law.m:g}")
        console.print(f"picture         {out}", soft_wrap=True)


def _table(phi: float, strengths: dict[str, Peak]) -> Table:
    from rich.table import Table

    from ..material.homogeneous import PATHS

    table = Table("strength in", "at", "Cauchy stress (MPa)", "W/phi", "gamma", box=None, pad_edge=False)
    for column in table.columns[1:]:
        column.justify = "right"
    for name, peak in strengths.items():
        symbol = "shear" if PATHS[name].free is None else "stretch"
        table.add_row(name, f"{symbol} {peak.at:.3f}", f"{peak.stress:#.4g}", f"{peak.W / phi:.3f}",
                      f"{peak.gamma:.3f}")
    return table


def _text(value: Any) -> str:
    return f"({', '.join(f'{x:g}' for x in value)})" if isinstance(value, tuple) else f"{value:g}"


def _value(name: str, text: Any) -> Any:
    """The number, quantity or vector in the text, or the text itself: the material then says what is allowed."""
    from ..material.constants import constant_unit
    from ..material.materials import UNITS
    from ..units import in_unit

    if not isinstance(text, str):
        return text
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        unit = UNITS.get(name, constant_unit(name))
        if not unit:
            return text
        numbers = tuple(in_unit(name, part.strip(), unit, plain="," in text) for part in text.split(","))
    return numbers[0] if len(numbers) == 1 else numbers


if __name__ == "__main__":
    from .program import command

    command(material, package="commands")
