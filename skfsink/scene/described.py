"""Whether the parameters of a scene describe it, or a part of it was made in Python and stands in no file."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from typing import Any

from ..errors import SkfsinkError
from ..meshing.reused import reusing
from .case import Case
from .controls import Controls
from .digest import digest
from .options import Options
from .scene import Scene

__all__ = ["made_in_python"]

#: parts of a scene that decide results
PARTS = ("material", "sink_law", "regions", "grips", "rollers", "tractions", "pressures", "loads", "event_at",
         "velocities", "faces", "whole", "probes", "cracks")


def made_in_python(scene: Scene, case: Case) -> tuple[str, ...]:
    """Names of the parts of a scene that are not those its parameters give; none if `scene.toml` describes it.

    The case makes the scene again from its parameters. A mesh that the run keeps in its folder is not read again.
    ("parameters",) are parameters from which the case makes no scene.
    """
    arguments, values = case.divide(scene.parameters)
    kept = bool(scene.sample.source or scene.sample.made)
    try:
        with reusing(scene.sample) if kept else nullcontext():
            again = case.scene({**case.default_arguments, **arguments}, replace(Options(), **values))
    except (SkfsinkError, AttributeError, KeyError, TypeError, ValueError):
        return ("parameters",)
    one, other = _parts(scene), _parts(again)
    return tuple(name for name in one if digest(one[name]) != digest(other[name]))


def _parts(scene: Scene) -> dict[str, Any]:
    """What of a scene decides results, by the name of the part."""
    sample = scene.sample
    return {**{name.replace("_", " "): getattr(scene, name) for name in PARTS},
            "controls": replace(scene.controls, checkpoint_every=Controls.checkpoint_every, stop=Controls.stop),
            "stop": scene.controls.stop,
            "sample": [sample.space.X, sample.space.conn, sample.boundaries]}
