"""How much U depends on the mesh and on lengths the paper does not print, from `cases/<case>/reference/spread.csv`.

With --compute the runs that are missing in these tables are made first; meshes of other seeds and lengths need gmsh.
"""

from __future__ import annotations

import csv
import io
import sys
from pathlib import Path
from threading import Lock
from typing import Annotated, Any

import matplotlib
import numpy as np
import paper
from compute import ROOT, finish, in_parallel
from cyclopts import App, Parameter
from layout import BLUE, RED, WIDTH, save, start
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from runs import SCANS, Scan

from skfsink.errors import OutputError, require
from skfsink.pictures import plot
from skfsink.results import reference
from skfsink.system.files import write_atomic

TABLE = "spread.csv"
RESULTS = [f"{quantity}_{analysis}_{when}" for quantity in "UD" for analysis in ("dynamic", "quasistatic")
           for when in ("at_arrival", "final")] + ["branches_dynamic", "branches_quasistatic", "elements"]
HERE = Path(__file__).resolve().parent
Row = dict[str, str]
_turn = Lock()  # at the tables
app = App(name="python figures/spread.py", help=__doc__, help_format="plaintext", version_flags=[])


# --- the tables ---
def read(case: str) -> list[Row]:
    """Rows of the table of a case; none if there is no table."""
    path = reference.reference_folder(case) / TABLE
    try:
        rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines())) if path.exists() else []
        if any(None in row or None in row.values() or not set(RESULTS) <= row.keys() for row in rows):
            raise ValueError("columns are missing")
        return rows
    except (OSError, ValueError, csv.Error) as error:
        raise OutputError(f"{path} is not a table of runs: {error}") from None


def rows_of(scan: Scan) -> list[Row]:
    """The rows of a scan that there are, in its order; parameters of other scans are empty in them."""
    def parameters(row: Row) -> dict[str, str]:
        return {name: value for name, value in row.items() if name not in RESULTS and value != ""}

    found = read(scan.case)
    wanted = [dict(zip(scan.columns, map(str, point), strict=True)) for point in scan.points]
    return [row for point in wanted for row in found if parameters(row) == point]


def append(scan: Scan, point: tuple[str | float, ...], results: dict[str, Any]) -> None:
    """Add a row to the table of the scan's case."""
    with _turn:
        rows = [*read(scan.case), {**dict(zip(scan.columns, map(str, point), strict=True)),
                                   **{name: str(results[name]) for name in RESULTS}}]
        names = list(dict.fromkeys(name for row in rows for name in row if name not in RESULTS)) + RESULTS
        text = io.StringIO()
        table = csv.DictWriter(text, names, restval="", lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
        folder = reference.reference_folder(scan.case)
        folder.mkdir(parents=True, exist_ok=True)
        write_atomic(folder / TABLE, text.getvalue())


def results_of(summary: dict[str, Any]) -> dict[str, Any]:
    """The columns of a row, from the summary of a run with both analyses."""
    row: dict[str, Any] = {"elements": summary["dynamic"]["elements"]}
    for analysis in ("dynamic", "quasistatic"):
        row[f"branches_{analysis}"] = summary[analysis]["event"]["max_branches"]
        for quantity, name in (("U", "U_paper"), ("D", "D_sink")):
            for when in ("at_arrival", "final"):
                value = summary[analysis]["energy"][f"{name}_{when}"]
                row[f"{quantity}_{analysis}_{when}"] = "nan" if value is None else f"{value:.6g}"
    return row


def run_scans(jobs: int) -> list[str]:
    """Make the runs that are not in the tables; returns a line for each that failed."""
    def one(item: tuple[Scan, tuple[str | float, ...]]) -> None:
        scan, point = item
        arguments = [word for name, value in zip(scan.columns, point) for word in
                     ("--" + name.replace("_", "-"), str(value))]
        label = "-".join(f"{name}{value}" if name != "mesh" else str(value) for name, value in zip(scan.columns, point))
        folder = finish(scan.case, [*arguments, "--analysis", "both"], ROOT / "results" / "spread" / scan.case / label)
        append(scan, point, results_of(reference.read_summary(folder)))

    present = {(scan, tuple(row[name] for name in scan.columns)) for scan in SCANS for row in rows_of(scan)}
    missing = [(scan, point) for scan in SCANS for point in scan.points
               if (scan, tuple(map(str, point))) not in present]
    return in_parallel(one, missing, jobs)


# --- the picture ---
def draw(path: Path) -> None:
    """Draw the figure: U of both analyses and their ratio, a column for each scan."""
    found = {scan: rows_of(scan) for scan in SCANS}
    if empty := [scan for scan, rows in found.items() if not rows]:
        raise OutputError(f"case {empty[0].case} has no rows over {empty[0].columns[-1]} in its {TABLE}")
    figure = Figure((WIDTH, 4.4), layout="constrained")
    axes = figure.subplots(2, len(found), squeeze=False, sharey="row", height_ratios=[3, 2])
    for i, (scan, rows) in enumerate(found.items()):
        _column(axes[0, i], axes[1, i], scan, rows)
        axes[0, i].set_title(f"({'abcdefgh'[i]}) {paper.SHORT[scan.case].replace(chr(10), ' ')}", loc="left")
    for ax in axes[:, 0]:
        ax.set_ylim(0, 1.05 * ax.get_ylim()[1])
    axes[0, 0].set_ylabel("$U$ at arrival (N mm/mm)")
    axes[1, 0].set_ylabel("dynamic over\nquasi-static")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    save(figure, path)


def _column(top: Axes, low: Axes, scan: Scan, rows: list[Row]) -> None:
    name = scan.columns[-1]
    x = np.array([float(row[name]) for row in rows])
    dynamic, slow = (np.array([float(row[f"U_{kind}_at_arrival"]) for row in rows])
                     for kind in ("dynamic", "quasistatic"))
    printed = {kind: paper.U.get((scan.case, kind)) for kind in ("dynamic", "quasistatic")}
    for values, kind, label, colour, mark in ((dynamic, "dynamic", "dynamic", RED, "o"),
                                              (slow, "quasistatic", "quasi-static", BLUE, "s")):
        top.plot(x, values, mark, color=colour, markersize=4, label=label)
        if (value := printed[kind]) is not None:
            top.axhline(value, color=colour, linestyle="--", linewidth=0.8, label=f"paper, {label}")
    ratios = dynamic / slow
    low.plot(x, ratios, "D", color="0.25", markersize=4)
    low.axhline(ratios.mean(), color="0.25", linewidth=0.8)
    text = f"mean {ratios.mean():.2f} (solid)"
    if printed["dynamic"] is not None and printed["quasistatic"] is not None:
        ratio = printed["dynamic"] / printed["quasistatic"]
        low.axhline(ratio, color="0.25", linestyle="--", linewidth=0.8)
        text += f", paper {ratio:.2f} (dashed)"
    low.set_title(text, fontsize=7, loc="left")
    seeds = name == "mesh_seed"
    low.set_xlabel(f"number of the mesh ({rows[0]['mesh']})" if seeds else name.replace("_", " ") + " (mm)")
    for ax in (top, low):
        ax.margins(x=0.15)
        ax.set_xticks(sorted(set(x)) if len(set(x)) < 7 else ax.get_xticks())
    top.tick_params(labelbottom=False)


@app.default
def main(*, compute: Annotated[bool, Parameter(negative="")] = False, jobs: int = 1,
         out: Annotated[Path, Parameter(show_default=False)] = HERE / "spread.png") -> int:
    """Draw the figure.

    Parameters
    ----------
    compute
        First make the runs that are missing, in `results/spread`; one that was interrupted goes on.
    jobs
        Runs at a time, 1 to 64.
    out
        File to write, spread.png beside this script unless given.
    """
    failed = run_scans(int(require("jobs", jobs, low=1, high=64, whole=True))) if compute else []
    for line in failed:
        print("skfsink:", line, file=sys.stderr)
    with matplotlib.rc_context(plot.STYLE):
        draw(out)
    print(out)
    return 1 if failed else 0


if __name__ == "__main__":
    start(app)
