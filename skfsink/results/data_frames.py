"""Tables of a run as data frames of pandas, which is optional; the name of each column says its unit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import MissingExtra, ParameterError, choose
from .history import HISTORY_COLUMNS, Table, deletions_header, history_header
from .release import RELEASE, load_release

if TYPE_CHECKING:
    from .loader import Run

__all__ = ["CONTENTS", "data_frame", "frame_of_run"]

#: what :meth:`.Run.to_pandas` gives besides probes
CONTENTS = ("history", "event", "tips", "deletions", "fragments", "release")
_OF_TIPS = ("step", "time_s", "tip_x_mm", "tip_y_mm", "tip_z_mm", "crack_length_mm", "tip_speed_m_per_s", "tips",
            "branches")


def data_frame(columns: Mapping[str, np.ndarray], units: Mapping[str, str]) -> Any:
    """Columns of one length as a `pandas.DataFrame`; its `attrs["units"]` has the `units` that are known.

    Raises
    ------
    MissingExtra
        There is no pandas.
    """
    try:
        import pandas
    except ImportError:
        raise MissingExtra("to_pandas needs pandas: pip install pandas") from None
    frame = pandas.DataFrame(dict(columns))
    frame.attrs["units"] = {name: units[name] for name in columns if name in units}
    return frame


def frame_of_run(run: Run, what: str) -> Any:
    """A data frame of a run, or of both runs of `analysis="both"`, which a column `analysis` then tells apart.

    Raises
    ------
    ParameterError
        `what` is none of `CONTENTS` and no probe.
    MissingExtra
        There is no pandas.
    """
    if not run.parts:
        return data_frame(*_columns(run, what))
    found = {name: _columns(part, what) for name, part in run.parts.items()}
    data_frame({}, {})  # says so if there is no pandas
    import pandas
    frames = [data_frame({"analysis": np.full(len(next(iter(columns.values()))), name), **columns}, units)
              for name, (columns, units) in found.items()]
    frame = pandas.concat(frames, ignore_index=True)
    frame.attrs["units"] = {"analysis": "", **next(iter(found.values()))[1]}
    return frame


def _columns(run: Run, what: str) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Columns by their names in files, and their units."""
    if what == "history":
        return _of_history(run.history)
    if what == "event":
        return _of_history(run.event)
    if what == "tips":
        columns, units = _of_history(run.event)
        return {name: columns[name] for name in _OF_TIPS if name in columns}, units
    if what == "deletions":
        clock, element = deletions_header(run.clock)
        return {clock: run.deletions.time, element: run.deletions.element}, {clock: run.clock, element: "1"}
    if what == "fragments":
        return dict(run.fragments), {}
    if what == "release":
        return load_release(run.folder / RELEASE), {}
    probes = run.probes
    if not isinstance(what, str):
        raise ParameterError(f"to_pandas takes a name, one of {', '.join((*CONTENTS, *probes))}; got {what!r:.80}")
    choose("what to_pandas gives", what, (*CONTENTS, *probes))
    return dict(probes[what]), dict(probes[what].units)


def _of_history(table: Table) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    names = dict(zip(HISTORY_COLUMNS, history_header(table.dim)))
    kept = [name for name in table if name not in table.without]
    return ({names.get(name, name): table[name] for name in kept},
            {names.get(name, name): table.units[name] for name in kept})
