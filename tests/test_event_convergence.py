"""The study of convergence: what it measures of an event, its limits and its table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skfsink.study import convergence as study


def point(n: int, seed: int) -> dict[str, Any]:
    """A made-up event: D per length converges to 0.007 with the rate 1, the mesh moves it by its seed."""
    h = 1 / n
    D = 0.007 * (1 + h) * 3 + 1e-4 * (seed - 1)
    return {"onset_displacement": 0.125 + 0.001 * h**2, "U": 0.05 + 0.1 * h, "D": D, "D_per_length": D / 3,
            "tip_speed": 26.0 - h, "first_branch": None if seed == 2 else 2.0, "branches": 2, "elements": 100 * n**2,
            "steps": 1000, "crack_length": 3.0, **({"cracked": [[1.5, 2.0, h], [2.5, 2.1, h]]} if not seed else {})}


POINTS = {f"{n}/{seed}": point(n, seed) for n in (3, 4, 6, 12) for seed in range(3)} | {"12/3": {"failed": "so"}}


def test_limits_and_rates() -> None:
    """Fails if means are taken over what failed or is missing, or a limit over sizes in the wrong order."""
    groups = study.sizes(dict(reversed(POINTS.items())))
    assert list(groups) == [3, 4, 6, 12] and {len(group) for group in groups.values()} == {3}
    found = study.limit(groups, "D_per_length")
    assert found is not None and found == pytest.approx((0.007, 1.0), rel=0.02)
    assert study.limit(groups, "onset_displacement") == pytest.approx((0.125, 2.0), rel=0.05)
    assert study.numbers(groups[3], "first_branch").tolist() == [2.0, 2.0]
    assert study.limit({n: groups[n] for n in (3, 4)}, "U") is None
    assert study.limit(groups, "U") is None  # 0.05 is a seventh below the finest mean
    assert study.limit({n: [{"U": value}] for n, value in ((3, 1.0), (4, 1.1), (6, 1.0), (12, 1.01))}, "U") is None


def test_the_table_and_the_pictures(tmp_path: Path) -> None:
    """Fails if a size is left out, or a picture cannot be drawn of points that lack a value."""
    lines = study.table(POINTS)
    assert len(lines) == 2 + 4 + 1 and lines[2].startswith("| l/3 | 3 | 900 | 0.1251") and "± " in lines[2]
    assert lines[-1].startswith("| limit (rate)")
    study.draw(POINTS, tmp_path / "event.png")
    layers = {str(n): point(n, 1) for n in (2, 3, 4)}
    study.draw_layers(layers, tmp_path / "layers.png")
    assert len(study.table_layers(layers)) == 5
    assert all((tmp_path / name).stat().st_size > 5000 for name in ("event.png", "event_cracks.png", "layers.png"))


def test_the_documented_tables_are_those_of_the_file() -> None:
    """Fails if the page has other figures than its JSON file, or a run that the plan does not have."""
    docs = Path(__file__).parents[1] / "docs"
    text = (docs / "convergence.md").read_text(encoding="utf-8").splitlines()
    stored = json.loads((docs / "images" / "convergence.json").read_text(encoding="utf-8"))
    assert stored["study"] == "convergence" and stored["machine"]["processor"]
    for part in (study.EVENT, study.LAYERS):
        start = f"{part.name}/"
        points = {k.removeprefix(start): p for k, p in stored["points"].items() if k.startswith(start)}
        assert points.keys() == {p.key for p in part.plan(False)}
        assert not [line for line in part.table(points) if line not in text]


def test_the_plan_has_five_seeds_of_each_size() -> None:
    """Fails if a size or a seed is missing, or if a key stands for two meshes."""
    keys = [planned.key for planned in study.plan(False)]
    assert len(set(keys)) == len(keys) == 30 and keys[0] == "3/0" and keys[-1] == "12/4"
    assert len(study.plan(True)) == 4 and [p.key for p in study.plan_layers(False)] == ["2", "3", "4"]


@pytest.mark.slow
def test_an_event_is_measured() -> None:
    """Fails if a quantity is missing, or the length of the crack is not that of its path: 3 mm and what branches."""
    pytest.importorskip("gmsh")
    found = study.Event(2, 0)()
    assert all(np.isfinite(found[name]) for name in ("onset_displacement", "U", "D", "tip_speed", "D_per_length"))
    assert 2.8 < found["crack_length"] < 9 and found["D_per_length"] == found["D"] / found["crack_length"]
    assert found["elements"] > 500 and found["steps"] > 100
    middles, side = np.split(np.array(found["cracked"]), [2], axis=1)
    cells = np.unique(np.floor(middles / study.L), axis=0)
    assert len(cells) * study.L == pytest.approx(found["crack_length"])
    assert found["U"] == pytest.approx(0.9514 * 0.1686 * np.sum(side**2), rel=2e-3)  # failed area times psi_f
