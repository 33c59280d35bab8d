"""The runs of the strip against Rivlin and Thomas: `python cases/pure_shear/tearing.py FOLDER ...`.

Far from the cut and from the ends the strip is in pure shear, F = diag(1, L, 1/L), with the stored energy
W(L) = psi(L^2 + 1/L^2 + 1) per undeformed volume. A crack that goes on by da turns W H da of it into none, H being the
undeformed height, so that its energy release rate is G = W H. The sink takes psi_f per volume that fails.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import skfsink
from skfsink.material import AAA
from skfsink.results.loader import Run

START, STOP = 1.0, 2.0  # heights from the tip of the cut, and from the end of the strip, between which it is steady


def stored(stretch: float, material: AAA = AAA()) -> float:  # noqa: B008
    """Stored energy W of pure shear [MPa]."""
    return float(material.isochoric(stretch**2 + stretch**-2 + 1)[0])


def figures(run: Run) -> dict[str, float]:
    """Onset, and mean slopes over the steady part, of a run; energies per length of crack in N/mm * mm."""
    X = run.scene.sample.space.X
    length, height = np.ptp(X, axis=0)
    cut = X[run.scene.sample.nodes("cut"), 0].max()
    law = run.scene.sink_law
    stretch = 1 + run.summary["onset"]["displacement_mm"] / height
    rows = run.event
    front = np.fmax.accumulate(np.nan_to_num(rows["tip_x_mm"]))
    steady = (front > cut + START * height) & (front < length - STOP * height)
    sink = rows["sink_stored"] + rows["sink_kinetic"]
    slope = {name: float(np.polyfit(front[steady], values[steady], 1)[0]) for name, values in
             (("elastic", rows["elastic"]), ("kinetic", rows["kinetic"]), ("sink", sink), ("time", rows["time_s"]))}
    past = 1 + (stretch - 1) * (1 + run.scene.controls.overshoot)
    return {"cut": cut, "height": height, "stretch": stretch, "onset": stored(stretch) * height,
            "toughness": law.failure_energy * law.length_scale, "G": stored(past) * height,
            "speed": 1e-3 / slope["time"], **{k: slope[k] for k in ("elastic", "kinetic", "sink")}}


if __name__ == "__main__":
    print("cut mm  H mm  onset L  W H, N/mm  of psi_f l |  G, N/mm  released  by the sink  kinetic  front, m/s")
    for folder in sys.argv[1:]:
        f = figures(skfsink.load(Path(folder)))
        print(f"{f['cut']:6.2f} {f['height']:5.2f} {f['stretch']:8.4f} {f['onset']:10.5f} "
              f"{f['onset'] / f['toughness']:11.3f} | {f['G']:9.5f} {-f['elastic'] / f['G']:8.3f} G "
              f"{f['sink'] / f['G']:9.3f} G {f['kinetic'] / f['G']:6.3f} G {f['speed']:10.2f}")
