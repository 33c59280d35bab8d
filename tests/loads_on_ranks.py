"""Events under loads of all kinds, on the ranks there are: `python tests/loads_on_ranks.py FOLDER [stop | resume]`.

On several: `mpiexec -n 2 python -m skfsink.methods.ranks tests/loads_on_ranks.py FOLDER`. Each kind runs in a folder of
its own; with `stop` it is stopped after some steps of the event, and with `resume` it goes on from there.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from guarded import NOTCHED, Stop, simulation
from test_pressure import INNER, at_radius, tube
from test_sliding import plate, rotation

from skfsink.errors import Interrupted
from skfsink.loads import BodyForce, Filling, Grip, Pressure, Ramp, Rotation, Traction
from skfsink.material import AAA, SinkLaw
from skfsink.meshing.sample import Sample
from skfsink.run.display import Display
from skfsink.run.simulate import Simulation
from skfsink.scene.controls import Controls
from skfsink.scene.scene import Scene

CONTROLS: dict[str, Any] = {"density_solver": "jacobi", "event_time": 1.2e-5, "overshoot": 0.01,
                            "checkpoint_every": 1e6, "frame_every": 1e-3}
BURST = {**CONTROLS, "event_time": 6e-5, "record_every": 2e-6}
STEPS = 150    # after which an event is stopped


def ring(load: Pressure | Filling) -> Scene:
    """A quarter of a ring with a thin place, between its planes of symmetry."""
    space = tube(8, 0.2)
    sides = {"left": np.flatnonzero(space.X[:, 0] < 1e-9), "bottom": np.flatnonzero(space.X[:, 1] < 1e-9),
             "inner": at_radius(space, INNER)}
    grips = Grip("left", (0.0, None)), Grip("bottom", (None, 0.0))
    return Scene("ring", "Ring", {"mesh": ""}, Sample("ring", space, sides), AAA(), SinkLaw(phi=0.05, length_scale=0.1),
                 grips, pressures=(load,), controls=Controls(**BURST))


def scenes() -> dict[str, Scene]:
    """A scene for each kind of load."""
    block, held = replace(NOTCHED.scene, controls=Controls(**CONTROLS)), Grip("bottom", (0.0, 0.0))
    weight = partial(BodyForce, rho0=1e-9, rate=(0.0, Ramp((0.0, 1.0), (0.0, 1e7))))
    return {"dead": replace(block, grips=(held,), tractions=(Traction("top", (0.0, 0.1)),), loads=(weight,)),
            "pressure": ring(Pressure("inner", 1e-3, True)),
            "filling": ring(Filling("inner", 1e-3, 1e-2)),
            "oblique": plate(rotation(2), **CONTROLS),
            "turn": replace(block, grips=(Rotation("top", 1.0, (1.0, 0.5)), held))}


def main(folder: Path, how: str = "") -> None:
    """Run all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, scene in scenes().items():
        if how == "resume":
            Simulation(scene, folder / name, Display(True), resume=True).run()
            continue
        with suppress(Interrupted):
            simulation(scene, folder / name, *([Stop(STEPS)] if how == "stop" else [])).run()


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
