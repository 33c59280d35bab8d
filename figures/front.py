"""How many points a quasi-static pass fails: U, D and passes of the plane scenes over `front`, text and picture.

Beside them stand over-damped events of one plate, which come to the same limit in another way.

Drawn from `cases/<case>/reference/spread.csv`; the runs are made by `spread.py --compute`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import paper
from layout import BLUE, RED, WIDTH, legend, save, script
from matplotlib.figure import Figure
from runs import FRONTS, OVERDAMPED
from spread import Row, rows_of, values

from skfsink.errors import OutputError
from skfsink.system.files import write_atomic

QUANTITIES = {"U": ("U_quasistatic_at_arrival", RED, "o"), "D": ("D_quasistatic_at_arrival", BLUE, "s")}


def draw(path: Path) -> None:
    """Draw the picture, and write the table beside it."""
    found = {scan.case: rows_of(scan) for scan in FRONTS}
    if empty := [case for case, rows in found.items() if not rows]:
        raise OutputError(f"case {empty[0]} has no rows over front in its spread.csv")
    creeping = rows_of(OVERDAMPED)
    write_atomic(path.with_suffix(".md"), table(found) + overdamped_table(found[OVERDAMPED.case], creeping))
    figure = Figure((WIDTH, 2.9), layout="constrained")
    axes = figure.subplots(1, len(found), sharey=True)
    for ax, letter, (case, rows) in zip(axes, "abcd", found.items()):
        for mesh, line in zip(dict.fromkeys(row["mesh"] for row in rows), ("--", "-")):
            these = [row for row in rows if row["mesh"] == mesh]
            for name, (column, colour, mark) in QUANTITIES.items():
                y = values(these, column)
                ax.plot(values(these, "front"), y / y[-1], line + mark, color=colour, markersize=3, linewidth=1,
                        label=f"${name}$, {'smaller' if line == '-' else 'larger'} elements")
            for row in creeping:  # U of over-damped events on the same mesh
                if (case, mesh) == (OVERDAMPED.case, row["mesh"]):
                    U = values(these, QUANTITIES["U"][0])[-1]
                    ax.plot(1.0, float(row["U_dynamic_at_arrival"]) / U, "*", color="k", markersize=5,
                            label="$U$, over-damped")
        ax.axhspan(0.97, 1.03, color="0.9")
        ax.set_title(f"({letter}) {paper.SHORT[case].replace(chr(10), ' ')}", loc="left")
        ax.set_xlabel("front")
    axes[0].set_ylabel("over the value at the last front")
    legend(figure, 3)
    save(figure, path)


def table(found: dict[str, list[Row]]) -> str:
    """U, D and passes, a row for each sample, mesh and quantity, a column for each value of `front`."""
    fronts = sorted({float(row["front"]) for rows in found.values() for row in rows})
    lines = ["Quasi-static, at the first arrival; energies in N mm/mm.", "",
             "| sample | mesh | | " + " | ".join(f"{front:g}" for front in fronts) + " |",
             "|" + "---|" * (3 + len(fronts))]
    for case, rows in found.items():
        for mesh in dict.fromkeys(row["mesh"] for row in rows):
            these = {float(row["front"]): row for row in rows if row["mesh"] == mesh}
            for name, column, digits in (("*U*", "U_quasistatic_at_arrival", 4), ("*D*", "D_quasistatic_at_arrival", 4),
                                         ("passes", "arrival_pass_quasistatic", 0)):
                cells = [f"{float(these[f][column]):.{digits}f}" if f in these and np.isfinite(float(these[f][column]))
                         else "–" for f in fronts]
                lines.append(f"| {paper.TITLES[case]} | {mesh} | {name} | " + " | ".join(cells) + " |")
    return "\n".join([*lines, ""])


def overdamped_table(fronts: list[Row], creeping: list[Row]) -> str:
    """Over-damped events, and below them the quasi-static analysis of the same mesh that fails the fewest points."""
    lines = ["", f"The limit by motion, {paper.TITLES[OVERDAMPED.case]}: so viscous that the crack creeps, with grips "
             "that go on moving.", "", "| | mesh | *U* | *D* | work of the grips | branches |", "|" + "---|" * 6]
    rows = [(f"{1e6 * float(row['viscosity']):g} Pa s, {float(row['speed']):g} mm/s", row, "dynamic")
            for row in creeping]
    mesh = OVERDAMPED.points[0][0]
    last = max((row for row in fronts if row["mesh"] == mesh), key=lambda row: float(row["front"]), default=None)
    if last is not None:
        rows.append((f"quasi-static, front {float(last['front']):g}", last, "quasistatic"))
    for name, row, kind in rows:
        energies = [f"{float(row[column]):.4f}" for column in (
            f"U_{kind}_at_arrival", f"D_{kind}_at_arrival", f"work_{kind}")]
        lines.append(f"| {name} | {row['mesh']} | {' | '.join(energies)} | {float(row[f'branches_{kind}']):g} |")
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    script(draw, __file__)
