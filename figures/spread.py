"""How far results hang on the mesh: U and D of the plane scenes on ten meshes each, beside the paper, text and picture.

Drawn from `cases/<case>/reference/spread.csv`. With --compute the runs that are missing in these tables are made first,
and those of the dimensions that were tried (`dimensions.md`) and of `front.py`; meshes of other seeds and lengths need
gmsh.
"""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Sequence
from pathlib import Path
from threading import Lock
from typing import Annotated, Any

import matplotlib
import numpy as np
import paper
from compute import ROOT, finish, in_parallel
from cyclopts import App, Parameter
from layout import ANALYSES, WIDTH, legend, save, start
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from runs import FRONTS, OVERDAMPED, SCANS, TRIED, Scan

from skfsink.errors import OutputError, require
from skfsink.pictures import plot
from skfsink.results import reference
from skfsink.system.files import write_atomic

TABLE = "spread.csv"
MEASURED = {"U_{}_at_arrival": ("energy", "U_paper_at_arrival"), "U_{}_final": ("energy", "U_paper_final"),
            "D_{}_at_arrival": ("energy", "D_sink_at_arrival"), "D_{}_final": ("energy", "D_sink_final"),
            "work_{}": ("energy", "external_work"),
            "arrival_s_{}": ("event", "first_arrival_s"), "arrival_pass_{}": ("event", "first_arrival_pass"),
            "tip_speed_{}": ("event", "mean_tip_speed_m_per_s"), "branches_{}": ("event", "max_branches"),
            "steps_{}": ("cost", "steps")}
RESULTS = ["elements", "onset_mm", "onset_energy", *(name.format(kind) for kind in ANALYSES for name in MEASURED)]
SIGMA, SHARE = 2.0, 0.1  # a mean agrees with the paper within so many standard deviations, or that share of its value
HERE = Path(__file__).resolve().parent
Row = dict[str, str]
_turn = Lock()  # at the tables
app = App(name="python figures/spread.py", help=__doc__, help_format="plaintext", version_flags=[])


# --- the tables of runs ---
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
    """The columns of a row, from the summary of a run with one analysis or both; nan for what it does not have."""
    parts = summary if "onset" not in summary else {summary["analysis"]: summary}
    one = next(parts[kind] for kind in ANALYSES if kind in parts)
    row = dict.fromkeys(RESULTS, "nan") | {
        "elements": one["elements"], "onset_mm": f"{one['onset']['displacement_mm']:.6g}",
        "onset_energy": f"{one['onset']['elastic_energy']:.6g}"}
    for kind in ANALYSES:
        for name, (group, key) in MEASURED.items():
            value = parts[kind][group][key] if kind in parts else None
            row[name.format(kind)] = "nan" if value is None else f"{value:.6g}"
    return row


def run_scans(scans: Sequence[Scan], jobs: int) -> list[str]:
    """Make the runs of some scans that are not in the tables; returns a line for each that failed."""
    def one(item: tuple[Scan, tuple[str | float, ...]]) -> None:
        scan, point = item
        arguments = [word for name, value in zip(scan.columns, point) for word in
                     ("--" + name.replace("_", "-"), str(value))]
        label = "-".join(f"{name}{value}" if name != "mesh" else str(value) for name, value in zip(scan.columns, point))
        folder = finish(scan.case, [*arguments, "--analysis", scan.analysis],
                        ROOT / "results" / "spread" / scan.case / label)
        append(scan, point, results_of(reference.read_summary(folder)))

    present = {(scan, tuple(row[name] for name in scan.columns)) for scan in scans for row in rows_of(scan)}
    missing = [(scan, point) for scan in scans for point in scan.points
               if (scan, tuple(map(str, point))) not in present]
    return in_parallel(one, missing, jobs)


# --- in words ---
def values(rows: Sequence[Row], column: str) -> np.ndarray:
    """A column (n,), nan where a run has no such value."""
    return np.array([float(row[column] or "nan") for row in rows])


def mean_text(numbers: np.ndarray, digits: int, scale: float = 1.0) -> str:
    """Mean ± standard deviation of those that there are, "–" if there are none."""
    there = scale * numbers[np.isfinite(numbers)]
    if not len(there):
        return "–"
    return f"{there.mean():.{digits}f}" + (f" ± {there.std(ddof=1):.{digits}f}" if len(there) > 1 else "")


def verdict(numbers: np.ndarray, printed: float) -> str:
    """How the mean of some values lies beside the one of the paper."""
    away = float(numbers.mean() / printed - 1)
    sigma = float(numbers.std(ddof=1)) if len(numbers) > 1 else 0.0
    agrees = abs(away) <= SHARE or abs(away) * printed <= SIGMA * sigma
    return f"{printed:.4g} ({away:+.0%}, {'agrees' if agrees else 'differs'})"


def spread_table(found: dict[Scan, list[Row]]) -> str:
    """Mean and standard deviation over the meshes, a row for each sample and analysis."""
    lines = ["Mean ± standard deviation over meshes of the same size that differ by their seed, at the first arrival.",
             "Energies in N mm per mm of thickness. The mean agrees with the paper within two standard deviations or "
             "10 %.", "",
             "| sample | mesh | meshes | onset (mm) | analysis | *U* | *U*, paper | *D* | arrival (µs) "
             "| tip speed (m/s) | branches |", "|" + "---|" * 11]
    ratios = ["| sample | *U*, dynamic over quasi-static | paper | *D*, dynamic over quasi-static |",
              "|---|---|---|---|"]
    for scan, rows in found.items():
        title = paper.TITLES[scan.case]
        for kind, (name, _) in ANALYSES.items():
            used = values(rows, f"U_{kind}_at_arrival")
            printed = paper.U.get((scan.case, kind))
            lines.append(" | ".join([
                f"| {title}", rows[0]["mesh"], str(len(rows)), mean_text(values(rows, "onset_mm"), 4), name,
                mean_text(used, 4), "" if printed is None else verdict(used, printed),
                mean_text(values(rows, f"D_{kind}_at_arrival"), 4),
                mean_text(values(rows, f"arrival_s_{kind}"), 0, 1e6), mean_text(values(rows, f"tip_speed_{kind}"), 1),
                mean_text(values(rows, f"branches_{kind}"), 1)]) + " |")
        over = {q: values(rows, f"{q}_dynamic_at_arrival") / values(rows, f"{q}_quasistatic_at_arrival") for q in "UD"}
        slow, fast = (paper.U.get((scan.case, kind)) for kind in ("quasistatic", "dynamic"))
        ratio = "" if slow is None or fast is None else verdict(over["U"], fast / slow)
        ratios.append(f"| {title} | {mean_text(over['U'], 2)} | {ratio} | {mean_text(over['D'], 2)} |")
    return "\n".join([*lines, "", *ratios, ""])


def tried_table(found: dict[Scan, list[Row]]) -> str:
    """What was tried of the dimensions that the paper does not print, a row for each set of them."""
    lines = ["Dimensions that the paper does not print, as tried; means ± standard deviation over meshes, at the first "
             "arrival.", "", "| sample | dimensions | meshes | elements | stored energy | *U*, dynamic "
             "| *U*, quasi-static | *D*, dynamic | branches |", "|" + "---|" * 9]
    for scan, rows in found.items():
        sets: dict[str, list[Row]] = {}
        for row in rows:
            words = [row[n] if n == "mesh" else f"{n.replace('_', ' ')} {row[n]}" for n in scan.columns
                     if n != "mesh_seed"]
            sets.setdefault(", ".join(words), []).append(row)
        for name, group in sets.items():
            lines.append(" | ".join([
                f"| {paper.TITLES[scan.case]}", name, str(len(group)), f"{values(group, 'elements').mean():,.0f}",
                mean_text(values(group, "onset_energy"), 4), mean_text(values(group, "U_dynamic_at_arrival"), 4),
                mean_text(values(group, "U_quasistatic_at_arrival"), 4),
                mean_text(values(group, "D_dynamic_at_arrival"), 4), mean_text(values(group, "branches_dynamic"), 1)])
                + " |")
    return "\n".join([*lines, ""])


# --- the picture ---
def draw(path: Path) -> None:
    """Draw the picture, and write the tables beside it: U, D and their ratios, a column for each scan."""
    found = {scan: rows_of(scan) for scan in SCANS}
    if empty := [scan for scan, rows in found.items() if not rows]:
        raise OutputError(f"case {empty[0].case} has no rows over {empty[0].columns[-1]} in its {TABLE}")
    write_atomic(path.with_suffix(".md"), spread_table(found))
    if tried := {scan: rows for scan in TRIED if (rows := rows_of(scan))}:
        write_atomic(path.with_name("dimensions.md"), tried_table(tried))
    figure = Figure((WIDTH, 5.6), layout="constrained")
    axes = figure.subplots(3, len(found), squeeze=False, sharey="row", height_ratios=[3, 3, 2])
    for i, (scan, rows) in enumerate(found.items()):
        _column(axes[:, i], scan, rows)
        axes[0, i].set_title(f"({'abcdefgh'[i]}) {paper.SHORT[scan.case].replace(chr(10), ' ')}", loc="left")
    for ax in axes[:, 0]:
        ax.set_ylim(0, 1.05 * ax.get_ylim()[1])
    for ax, text in zip(axes[:, 0], ("$U$ at arrival (N mm/mm)", "$D$ at arrival (N mm/mm)",
                                     "dynamic over\nquasi-static")):
        ax.set_ylabel(text)
    legend(figure, 3)
    save(figure, path)


def _column(axes: Sequence[Axes], scan: Scan, rows: list[Row]) -> None:
    """U, D and ratios of one scan; the means are lines, the standard deviations bands."""
    name = scan.columns[-1]
    x = values(rows, name)
    for ax, quantity in zip(axes, "UD"):
        for mark, (kind, (label, colour)) in zip("os", ANALYSES.items()):
            y = values(rows, f"{quantity}_{kind}_at_arrival")
            ax.plot(x, y, mark, color=colour, markersize=3.5, label=label)
            _mean(ax, y, colour)
            if quantity == "U" and (printed := paper.U.get((scan.case, kind))) is not None:
                ax.axhline(printed, color=colour, linestyle="--", linewidth=0.9, label=f"paper, {label}")
    for quantity, mark, colour in (("U", "D", "0.2"), ("D", "v", "0.6")):
        ratio = values(rows, f"{quantity}_dynamic_at_arrival") / values(rows, f"{quantity}_quasistatic_at_arrival")
        axes[2].plot(x, ratio, mark, color=colour, markersize=3.5, label=f"ratio of ${quantity}$")
        _mean(axes[2], ratio, colour)
    if (scan.case, "quasistatic") in paper.U:
        axes[2].axhline(paper.U[scan.case, "dynamic"] / paper.U[scan.case, "quasistatic"], color="0.2", linestyle="--",
                        linewidth=0.9, label="paper, ratio of $U$")
    axes[2].axhline(1.0, color="k", linewidth=0.5)
    axes[2].set_xlabel(f"number of the mesh ({rows[0]['mesh']})")
    for ax in axes:
        ax.set_xlim(-0.7, len(scan.points) - 0.3)
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.tick_params(labelbottom=ax is axes[2])


def _mean(ax: Axes, y: np.ndarray, colour: str) -> None:
    there = y[np.isfinite(y)]
    if len(there) > 1:
        mean, sigma = there.mean(), there.std(ddof=1)
        ax.axhline(mean, color=colour, linewidth=0.7)
        ax.axhspan(mean - sigma, mean + sigma, color=colour, alpha=0.12, linewidth=0)


@app.default
def main(*, compute: Annotated[bool, Parameter(negative="")] = False, jobs: int = 1,
         out: Annotated[Path, Parameter(show_default=False)] = HERE / "spread.png") -> int:
    """Draw the figure, and write `spread.md` and `dimensions.md` beside it.

    Parameters
    ----------
    compute
        First make the runs that are missing, in `results/spread`; one that was interrupted goes on.
    jobs
        Runs at a time, 1 to 64.
    out
        File to write, spread.png beside this script unless given.
    """
    jobs = int(require("jobs", jobs, low=1, high=64, whole=True))
    failed = run_scans((*SCANS, *TRIED, *FRONTS, OVERDAMPED), jobs) if compute else []
    for line in failed:
        print("skfsink:", line, file=sys.stderr)
    with matplotlib.rc_context(plot.STYLE):
        draw(out)
    print(out)
    return 1 if failed else 0


if __name__ == "__main__":
    start(app)
