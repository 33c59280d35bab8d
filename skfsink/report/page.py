"""The page: what runs have left in their folders, put into the template with every picture inside."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from ..errors import OutputError
from ..results.loader import Run, load
from ..results.tables import EMPTY, Row, Table, cost_table, energy_tables, key_table, version_table
from ..system.files import path_of, reported, write_atomic
from ..system.version import __version__
from . import charts
from .citation import bibtex, citations
from .scenes import command_line, differences, kind, parameter_table, run_labels, wave_speeds

__all__ = ["environment", "report_page", "write_report"]

_KINDS = {".png": "image/png", ".gif": "image/gif", ".svg": "image/svg+xml"}
#: Pictures of a run that are on the page in this order beside those of the density and the speed.
FIELDS = (
    ("von_mises.png", "Von Mises stress", "Von Mises stress on the deformed body at the key moments"),
    ("principal_stress.png", "Greatest principal stress", "Greatest principal stress on the deformed body"),
    ("pressure.png", "Pressure", "Pressure on the deformed body at the key moments"),
    ("stretch.png", "Greatest principal stretch", "Greatest principal stretch on the deformed body"),
    ("W.png", "Energy density", "Stored energy density of the undamaged material on the deformed body"),
    ("fibres.png", "Fibres", "Directions of the fibres on the undeformed body"),
)
#: Pictures of a run: file, title, what it shows.
PICTURES = (
    ("density.png", "Relative density", "Relative density γ on the deformed body at the key moments"),
    ("speed.png", "Speed of the material", "Speed of the material on the deformed body at the key moments"),
    ("loading.png", "Loading", "Load over displacement, or pressure over volume, of the loading, and least density"),
    ("energies.png", "Energy ledger", "Where the energy of the event is over time, stacked, and what does not add up"),
    ("tip.png", "Tip of the crack", "Length of the crack, position and speed of its leading tip, and branches"),
    ("release.png", "Energy release rate", "Energy release rate and speed of each tip over time"),
    ("fragments.png", "Pieces", "The deformed body at the end, coloured by the pieces into which it has come apart"),
    ("lines.png", "Lines", "What probes on lines show as the loading ends (full) and as the event does (dashed)"),
    ("probes.png", "Probes", "What the probes followed: in the loading over displacement, in the event over time"),
    *FIELDS,
    ("animation.gif", "Animation", "Relative density γ on the deformed body, moving"),
)
_CARDS = ("displacement of the grips at the onset", "load at the onset", "first arrival of the crack at an edge",
          "mean tip speed until the first arrival or the end", "U at the first arrival", "D at the first arrival")


@dataclass(frozen=True)
class Picture:
    """A picture with everything inside: its `data:` address, title and words for those who cannot see it."""

    source: str
    title: str
    alt: str


@dataclass(frozen=True)
class Part:
    """A run on the page."""

    label: str
    what: str
    note: str
    pictures: dict[str, Picture]
    warnings: tuple[str, ...]
    assumed: tuple[str, ...]
    choice: tuple[Row, ...]
    choice_text: str
    parameters: Table
    command: str
    finished: bool
    verdict: str


def write_report(folders: Sequence[str | Path], out: str | Path | None = None) -> Path:
    """Write the report of one run, or of several compared, and return its path.

    Parameters
    ----------
    folders: of runs, finished or not.
    out: file to write; default `report.html` in the folder of a single run, `comparison.html` here for several.

    Raises
    ------
    OutputError
        No folder, one without a run or without any event, or the file cannot be written.
    """
    if isinstance(folders, str | Path):
        raise OutputError(f"folders must be a list of them; got {str(folders)!r}: write [{str(folders)!r}]")
    if not folders:
        raise OutputError("name at least one folder of a run")
    runs = [path_of("folder", folder) for folder in folders]
    out = path_of("out", out) if out else (runs[0] / "report.html" if len(runs) == 1 else Path("comparison.html"))
    if out.is_dir():
        raise OutputError(f"the report cannot be written to {out}: that is a folder; name a file with --out")
    write_atomic(out, report_page([load(folder) for folder in runs]))
    return out


def report_page(asked: Sequence[Run]) -> str:
    """The page as text, for the runs in these folders."""
    runs = [part for run in asked for part in run.runs]
    for run in runs:
        if run.analysis == "both" or not (run.event["step"].size or run.finished):
            raise OutputError(f"the run in {run.folder} has not come to its event yet: there is nothing to report")
    labels = run_labels(runs)
    waves = [wave_speeds(run) for run in runs]
    keys = key_table(runs, labels, waves)
    several = len(runs) > 1
    drawn = [(title, chart) for title, chart in (
        ("Speed of the tip", charts.speed_chart(runs, labels, waves)),
        ("Energies over the length of the crack", charts.energy_chart(runs, labels)),
        ("Loading", charts.loading_chart(runs, labels))) if chart is not None]
    comparisons = [_picture(run.folder / "comparison.png", "Dynamic beside quasi-static",
                            "The dynamic crack beside the quasi-static one, and the energies of both at the end")
                   for run in asked if run.parts]
    parts = [_part(run, label, several) for run, label in zip(runs, labels)]
    return environment("skfsink.report").get_template("page.html").render(
        title=_title(asked), several=several, labels=labels, keys=keys,
        cards=[] if several else [row for row in keys.rows if row.name in _CARDS],
        charts={title: Picture(_data(chart.svg, ".svg"), title, chart.alt) for title, chart in drawn},
        comparisons=[picture for picture in comparisons if picture], energies=energy_tables(runs, labels),
        parts=parts, titles={title for part in parts for title in part.pictures},
        fields=[title for _, title, _ in FIELDS],
        differences=differences(runs, labels) if several else None,
        same_assumed=len({run.assumed for run in runs}) == 1, cost=cost_table(runs, labels),
        versions=version_table(runs, labels), citations=citations(), bibtex=bibtex(), version=__version__)


def environment(*packages: str) -> Environment:
    """Of the templates in the folders of some packages, the first of which goes first."""
    made = Environment(loader=ChoiceLoader([PackageLoader(name, "") for name in packages]), autoescape=True,
                       undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    made.filters["symbols"] = _symbols
    return made


def _title(asked: Sequence[Run]) -> str:
    names = list(dict.fromkeys(run.title for run in asked))
    if len(asked) > 1:
        return f"{len(asked)} runs compared: {', '.join(names)}"
    run = asked[0]
    return f"{names[0][0].upper()}{names[0][1:]}, mesh {Path(str(run.parameters.get('mesh', ''))).stem}, {kind(run)}"


def _part(run: Run, label: str, several: bool) -> Part:
    lead = f"{label}: " if several else ""
    pictures = {title: _picture(run.folder / name, title, lead + alt) for name, title, alt in PICTURES}
    choice = run.summary.get("model") or run.model_choice
    rows = tuple(Row(name.replace("_", " "), "", (_flat(value),)) for name, value in choice.items() if name != "text")
    return Part(label, f"{run.title}, mesh {run.parameters.get('mesh', EMPTY)}, {kind(run)}",
                _note(run), {title: picture for title, picture in pictures.items() if picture}, tuple(run.warnings),
                run.assumed, rows, str(choice.get("text", "")), parameter_table(run), command_line(run), run.finished,
                run.verdict)


def _flat(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name.replace('_', ' ')} {_flat(item)}" for name, item in value.items())
    if isinstance(value, list):
        return ", ".join(map(str, value))
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _picture(path: Path, title: str, alt: str) -> Picture | None:
    if not path.is_file():
        path = path.with_suffix(".svg")  # as a run with `pictures = "svg"` leaves it
    if not path.is_file():
        return None
    with reported(f"cannot read {path}"):
        return Picture(_data(path.read_bytes(), path.suffix), title, alt)


def _data(content: bytes, suffix: str) -> str:
    return f"data:{_KINDS[suffix]};base64,{base64.b64encode(content).decode()}"


def _symbols(text: str) -> Markup:
    """Symbols with their index below the line: c_R, c_s, ψ_f."""
    return Markup(re.sub(r"\b([cψ])_([fRs])\b", r"<i>\1</i><sub>\2</sub>", str(Markup.escape(text))))


def _note(run: Run) -> str:
    """What is to be said of a run that computed a part of the sample only, or whose parameters are not all of it."""
    return "; ".join(filter(None, (_of_python(run), _of_part(run))))


def _of_python(run: Run) -> str:
    """Of a run of which a part of the scene was made in Python."""
    return (f"parts were made in Python ({', '.join(run.made_in_python)}), which parameters and command do not describe"
            if run.made_in_python else "")


def _of_part(run: Run) -> str:
    """Of a run that computed a part of the sample only."""
    whole = run.summary.get("whole") or {}
    if all(factor == 1.0 for factor in whole.values()):
        return ""
    return ("computed was a part of the sample, and energies, loads and curves are those of the part; of the whole: "
            + ", ".join(f"{name} × {factor:g}" for name, factor in whole.items()))
