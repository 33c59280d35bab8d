"""Frames of the fields for ParaView, of the loading and of the event, and which of them show the key moments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...fields.frame_fields import ON_REQUEST
from ...fields.momentum import Momentum
from ...fields.state import State
from ...fields.stress import cauchy_stress, pressure, von_mises
from ...methods.ranks.crew import Member
from ...results.frame import ELEMENT, NODE
from ...results.series import Series, frame_mesh, write_piece
from ...system.files import prepare_folder
from .observer import Observer
from .view import View

__all__ = ["Frames"]


class Frames(Observer):
    """Writes the series `run` of the event and `loading` of the way to it.

    Memory: how many frames there are, and which are of key moments.

    Parameters
    ----------
    every: time between frames of the event [s].   every_passes: passes between them in a quasi-static one.
    fields: names of :data:`.frame_fields.ON_REQUEST` that frames have besides the others.

    Attributes
    ----------
    moments: frame number of each key moment: onset, branching, arrival, end.
    times: of the frames of the event.   loading_times: of those of the loading.
    """

    LOADING = 50.0  # of the way of the loading: its frames are at least that part of it apart
    kept = ("times", "loading_times", "moments", "framed")

    def __init__(self, every: float, every_passes: int = 10, fields: Sequence[str] = ()) -> None:
        self.every, self.every_passes, self.fields = every, every_passes, tuple(fields)
        self.times: list[float] = []
        self.loading_times: list[float] = []
        self.moments: dict[str, int] = {}
        self.framed = 0.0  #: way of the loading at its last frame

    def open(self, view: View, memory: Mapping[str, Any] | None = None) -> None:
        """Take up the frames so far; OutputError where they are not there any more."""
        super().open(view, memory)
        self._new = memory is None
        space, folder = view.body.space, view.folder / "series"
        self.series, self.loading_series = Series(folder, "run", space), Series(folder, "loading", space)
        self._still = {"region": view.scene.region_numbers} if view.scene.regions else {}
        if (fibres := view.scene.fibres) is not None:
            self._still |= {f"fibre_{f + 1}": np.nan_to_num(fibres[:, f]) for f in range(fibres.shape[1])}
        self.series.check(len(self.times))
        self.loading_series.check(len(self.loading_times))

    def prepare(self, view: View) -> None:
        """Drop what is left of later frames, or of another run."""
        if self._new:
            prepare_folder(view.folder / "series", overwrite=True)
        self.series.resume(len(self.times))
        self.loading_series.resume(len(self.loading_times))

    def loading(self, view: View) -> None:
        """A frame where the way of the loading asks for one."""
        if view.way >= self.framed + max(1.0, self.framed / self.LOADING):
            self.framed = view.way
            self._add_to_loading(view)

    def _add_to_loading(self, view: View) -> None:
        self.loading_times.append(view.state.time)
        self._add(self.loading_series, view)

    def unfailed(self, view: View) -> None:
        """Last frame of a run that ends without a failure."""
        if not self.loading_times or self.loading_times[-1] != view.state.time:
            self._add_to_loading(view)
        self.moments = {"end": len(self.loading_times) - 1}
        self._flush()

    def due(self, view: View) -> bool:
        """At key moments, and each time `every` is past."""
        return bool(view.moment) or super().due(view)

    def look(self, view: View) -> None:
        """Add a frame."""
        label = {"begin": "onset", "step": view.moment, "end": "end"}[view.occasion]
        if label:
            self.moments[label] = len(self.times)
        self.times.append(view.state.time)
        self._add(self.series, view)

    def _add(self, series: Series, view: View) -> None:
        state, pieces = view.state, view.looked.pieces
        if pieces is not None:
            series.add_pieces(state.time, pieces.number,
                              lambda folder: pieces.each(_write_piece, folder, self.fields, self._still))
            view.framed = True
            return
        series.add(state.time, *_fields(view.body.momentum, state, view.stress, self.fields, self._still))

    def finish(self, view: View) -> None:
        """Wait until all frames are written."""
        self._flush()

    def _flush(self) -> None:
        self.series.flush()
        self.loading_series.flush()

    def close(self) -> None:
        """Wait for the frame that is being written, whatever becomes of it."""
        self.series.close()
        self.loading_series.close()

    def memory(self) -> dict[str, Any]:
        """A checkpoint names its frames: they are written before it."""
        self._flush()
        return super().memory()


def _fields(momentum: Momentum, state: State, stress: np.ndarray, names: Sequence[str],
            still: Mapping[str, np.ndarray]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """What a frame has on points, and on cells; `still` is the same in all frames."""
    space = momentum.space
    return ({"displacement": state.u, "velocity": state.v, "gamma": state.gamma},
            {"deleted": state.deleted.astype(np.int8), "W": space.element_mean(np.minimum(momentum.W, 1e3)),
             "gamma_element": space.element_mean(momentum.gamma), "stress": stress, "pressure": pressure(stress),
             "von_mises": von_mises(stress), "crushed": np.isnan(stress).any(axis=1).astype(np.int8),
             **{name: ON_REQUEST[name](momentum, state.u, stress) for name in names if name in ON_REQUEST}, **still})


def _write_piece(member: Member, folder: Path, names: Sequence[str], still: Mapping[str, np.ndarray]) -> list[str]:
    """Write what a rank has of a frame; see :func:`_fields`, `still` is of the whole body."""
    assert member.part is not None
    numbers, momentum, space = member.part.numbers, member.body.momentum, member.body.space
    points, cells = _fields(momentum, member.state, cauchy_stress(momentum, member.state.u), names,
                            {name: values[numbers.elements] for name, values in still.items()})
    return write_piece(folder, member.comm.rank, frame_mesh(
        space, {**points, NODE: numbers.nodes}, {**cells, ELEMENT: numbers.elements}))
