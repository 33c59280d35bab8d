"""Energy release rate of the single-edge notched plate: `python figures/release_rate.py [MESH]`.

Runs the scene of the paper with the observer `EnergyRelease` into results/release_rate, whose `release.png` is
`docs/images/release_rate.png`, and prints what `docs/release_rate.md` says of it.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import skfsink
from skfsink.cases.single_edge_notch import single_edge_notch
from skfsink.results.release import load_release
from skfsink.run.observers import EnergyRelease

if __name__ == "__main__":
    mesh, folder = sys.argv[1] if len(sys.argv) > 1 else "M3", Path("results/release_rate")
    options = skfsink.Options(observers=(EnergyRelease(every=1e-6),), out=str(folder), overwrite=True)
    result = single_edge_notch(mesh=mesh, options=options)
    rates, law = load_release(folder / "release.csv"), result.scene.sink_law
    toughness, G = law.failure_energy * law.length_scale, rates["G_N_per_mm"]
    print(f"psi_f l {toughness:.5f} N/mm; G at the onset {G[0] / toughness:.3f} psi_f l")
    event, history = rates["phase"] == "event", skfsink.load(folder).event
    alone = event & (rates["tip"] == 1) & (rates["x_mm"] > 1.5) & (rates["x_mm"] < 2.5)
    places, times = np.column_stack([rates["x_mm"], rates["y_mm"]])[alone], rates["time_s"][alone]
    way = np.linalg.norm(np.diff(places[::4], axis=0), axis=1).sum()
    taken = np.interp(times[[0, -1]], history["time_s"], history["sink_stored"] + history["sink_kinetic"])
    print(f"x 1.5 to 2.5 mm: mean G {np.nanmean(G[alone]):.5f}, without kinetic terms "
          f"{np.nanmean(rates['G_static_N_per_mm'][alone]):.5f}, by the sink "
          f"{(taken[1] - taken[0]) / way:.5f} N/mm of its way")
    for tip in (1, 2):
        there = event & (rates["tip"] == tip) & (rates["time_s"] > 85e-6) & (rates["time_s"] < 115e-6)
        print(f"85 to 115 us: tip {tip}, mean G {np.nanmean(G[there]):.5f} N/mm")
