"""Writes docs/scenes.md from the docstrings of the cases, their reference results and the figures."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

from skfsink.results.history import onset_load
from skfsink.results.loader import Run, load
from skfsink.scene.registry import find_case
from skfsink.system.shipped import data_folder

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "figures"))
from runs import CASES, FIGURES, RUNS  # noqa: E402

HEAD = """# The six scenes

The six examples of the paper, Sec. 5.1 to 5.6. Each is `python -m skfsink.cases.NAME`, or a deck ([first
crack](first_crack.md#decks)); what the paper says of each stands beside what comes out here in [paper](paper.md). The
lengths are not printed in the paper, and those used are listed below as assumed.

This page is made from the cases and their stored results (`cases/NAME/reference`) by `python docs/make/scenes.py`; the
figures by `python figures/redraw.py`, with `--compute` after running the cases again. In the tables, $U$ is the paper's
dissipated energy at the first arrival of the crack at a free edge and $D$ the energy that the sink takes until then
([theory](theory.md)); load, $U$ and $D$ of plane scenes are per mm of thickness.
"""


def page() -> str:
    """The page."""
    return HEAD + "".join(f"\n{line}" for case in CASES for line in _scene(case)) + "\n"


def _scene(name: str) -> Iterator[str]:
    case = find_case(name)
    runs = [load(data_folder(name) / "reference" / run.key) for run in RUNS if run.case == name and run.key != "coarse"]
    title = runs[0].scene.title
    yield f"## {title}\n"
    yield textwrap.fill(case.description, 120) + "\n"
    figure = next(key for key, needs in FIGURES.items() if any(need.startswith(f"{name}/") for need in needs))
    yield f"![{title}](../figures/{figure}.png)\n"
    yield f"```bash\npython -m skfsink.cases.{name} --mesh coarse --analysis both\n```\n"
    yield "| parameter | default | meaning |\n|---|---|---|"
    for parameter in case.arguments:
        default = f"{parameter.default} {parameter.unit}".strip()
        yield f"| `{parameter.name}` | {default} | {parameter.meaning.replace('<', '&lt;')} |"
    units = runs[0].history.units
    force, work = units["reaction_N_per_mm"], units["elastic"]
    yield (f"\n| reference | elements | onset at (mm) | load ({force}) | $U$ ({work}) | $D$ ({work}) | arrival | "
           f"tip speed (m/s) | branches |")
    yield "|---|---|---|---|---|---|---|---|---|"
    yield from map(_row, runs)
    yield "\nAssumed:\n"
    yield from (f"- {text}" for text in runs[0].summary["assumed"])
    yield ""


def _row(run: Run) -> str:
    s = run.summary
    onset, event, energy = s["onset"], s["event"], s["energy"]
    time, speed = event["first_arrival_s"], event["mean_tip_speed_m_per_s"]
    if run.analysis == "quasistatic":
        arrival, motion = f"pass {event['first_arrival_pass']:.0f}", "–"
    else:
        arrival, motion = f"{time * 1e6:.0f} µs", f"{speed:.1f}"
    return (f"| {run.folder.name} | {s['elements']:,} | {onset['displacement_mm']:.3f} | "
            f"{onset_load(onset):.3g} | {energy['U_paper_at_arrival']:#.2g} | "
            f"{energy['D_sink_at_arrival']:#.2g} | {arrival} | {motion} | {event['max_branches']} |")


if __name__ == "__main__":
    (ROOT / "docs" / "scenes.md").write_text(page(), encoding="utf-8")
