"""Speeds of the cracks of runs against those of waves: `python cases/centre_crack/speed.py FOLDER ...`.

The front is how far any tip has come along the strip, in the undeformed body; its speed is a fit over the middle half
of its way, or of the part of it that it makes before the strip comes apart. Waves: c_s and c_R of the undeformed
material, and the transverse and the longitudinal plane wave along the strip in the stretched sheet ahead of the crack,
in the undeformed body as well: rho0 c^2 = A_2121 and A_1111, A being the tangent modulus of a sheet with free faces.
"""

from __future__ import annotations

import sys
from pathlib import Path

import meshio
import numpy as np

import skfsink
from skfsink.material import Material
from skfsink.results.loader import Run


def waves(material: Material, along: float, across: float) -> tuple[float, float]:
    """Speeds of the transverse and the longitudinal wave along a sheet stretched so [m/s]."""
    F = material.thin_sheet(np.diag([along, across])[None])
    A = material.modulus(F)[0]
    A = A - np.einsum("iJ,kL->iJkL", A[:, :, 2, 2], A[2, 2]) / A[2, 2, 2, 2]
    transverse, longitudinal = np.sqrt([A[1, 0, 1, 0], A[0, 0, 0, 0]] / np.array(material.rho0)) * 1e-3
    return float(transverse), float(longitudinal)


def stretches(run: Run) -> tuple[float, float]:
    """Stretches of the sheet along and across the strip just past the onset, from the long edge and the height."""
    frame = meshio.read(run.folder / "series" / "run_0000.vtu")
    X, x = frame.points, frame.points + frame.point_data["displacement"]
    top = X[:, 1] == X[:, 1].max()
    return float(np.ptp(x[top, 0]) / np.ptp(X[top, 0])), float(np.ptp(x[:, 1]) / np.ptp(X[:, 1]))


def figures(run: Run) -> dict[str, float]:
    """Stretches, speed of the front and of waves [m/s], and numerical dissipation over the energy, of a run."""
    scene, X = run.scene, run.scene.sample.space.X
    rows = run.event
    front = np.fmax.accumulate(np.abs(np.nan_to_num(rows["tip_x_mm"])))
    start, end = X[scene.sample.nodes("crack"), 0].max(), X[:, 0].max()
    fitted = (front > start + 0.25 * (end - start)) & (front < start + 0.75 * (end - start))
    speed = np.nan  # of a front that comes less far along the strip
    if fitted.any() and np.ptp(front[fitted]) > 0.1 * (end - start):
        speed = float(np.polyfit(rows["time_s"][fitted], front[fitted], 1)[0]) * 1e-3
    along, across = stretches(run)
    transverse, longitudinal = waves(scene.material, along, across)
    return {"along": along, "across": across, "speed": speed,
            "c_s": scene.material.shear_wave_speed, "c_R": scene.material.rayleigh_wave_speed,
            "transverse": transverse, "longitudinal": longitudinal, "branches": run.summary["event"]["max_branches"],
            "numerical": run.summary["energy"]["numerical"] / run.summary["energy"]["initial"]}


HEADER = "phi MPa  stretched along, across  front m/s  of c_s  of c_R  of transverse, longitudinal  tips  numerical"


def line(run: Run, f: dict[str, float]) -> str:
    """The figures of a run under `HEADER`."""
    return (f"{run.scene.sink_law.phi:7.3g} {f['along']:15.3f} {f['across']:7.3f} {f['speed']:10.2f} "
            f"{f['speed'] / f['c_s']:7.3f} {f['speed'] / f['c_R']:7.3f} {f['speed'] / f['transverse']:14.3f} "
            f"{f['speed'] / f['longitudinal']:12.3f} {f['branches']:5.0f} {f['numerical']:10.2%}")


if __name__ == "__main__":
    print(HEADER)
    for folder in sys.argv[1:]:
        found = skfsink.load(Path(folder))
        print(line(found, figures(found)))
