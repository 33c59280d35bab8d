"""The way of a run to its onset, wherever its rows are: of two analyses the second has them in the folder of the first.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .history import History, Table

__all__ = ["has_pressure", "loaded_in", "pressure_alone", "way_to_onset"]


def loaded_in(folder: Path) -> Path:
    """Folder of the run whose loading led a run to its onset: its own, or of a part of both analyses the dynamic one.
    """
    other = folder.absolute().parent / "dynamic"
    shared = folder.absolute().name == "quasistatic" and (other / "history.csv").is_file()
    return other if shared and _loading(History.load(folder / "history.csv"))["step"].size < 2 else folder


def way_to_onset(folder: Path) -> Table:
    """Rows of the history in which the body of the run in a folder was loaded.

    Raises
    ------
    OutputError
        There is no history, or it is damaged.
    """
    own = _loading(History.load(folder / "history.csv"))
    if (there := loaded_in(folder)) == folder:
        return own
    rows = _loading(History.load(there / "history.csv"))
    same = own["step"].size == 1 and np.array_equal(own["grip_displacement_mm"], rows["grip_displacement_mm"][-1:])
    return rows if same else own


def has_pressure(history: Table) -> bool:
    """Whether a pressure or a filling acts on the body."""
    return "pressure_MPa" not in history.without and bool(np.any(history["pressure_MPa"]))


def pressure_alone(history: Table) -> bool:
    """Whether load and displacement are those of a pressure: no grip moves, and the displacement is the swept volume
    over an area."""
    if not has_pressure(history):
        return False
    swept, displacement = history["swept_volume"], history["grip_displacement_mm"]
    if not swept.size or not swept.any() or not displacement.any():
        return bool(swept.size and swept.any() == displacement.any())
    greatest = int(np.argmax(np.abs(swept)))
    return np.allclose(displacement, swept * (displacement[greatest] / swept[greatest]), rtol=1e-6)


def _loading(history: Table) -> Table:
    rows = history["phase"] == "loading"
    return Table({name: values[rows] for name, values in history.items()}, history.dim, history.without)
