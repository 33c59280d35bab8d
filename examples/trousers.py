"""Trousers: a sheet cut into two legs, which are pulled to either side of it.

The test of Rivlin and Thomas on a small sheet of hexahedra, loaded statically and not torn. The number: with the
energies E that are stored at one opening with cuts of 2.0 and 2.2 mm, -dE/(t da) is the energy release rate G,
whatever the legs do; the domain integral around the tip must give the same. For coarse elements and a difference over
0.2 mm: 10 %.
"""

import numpy as np

import skfsink as sk

T = 0.2  # thickness [mm]


class Rate(sk.Observer):
    """Energy release rate at the tip of the cut [N/mm]."""

    def __init__(self, tip):
        self.tip, self.G = tip, []

    def loading(self, view):
        self.G.append(sk.energy_release_rate(view.body, view.state, self.tip, [1, 0, 0], 0.45, front=[0, 0, 1]).G)


def opened(cut):
    """Stored energy [N mm] and G [N/mm] of trousers with that cut, and the run."""
    rate = Rate((cut, 0.55, T / 2))
    corners = [[0, 0.55, 0], [cut, 0.55, 0], [cut, 0.55, T], [0, 0.55, T]]
    run = sk.custom(mesh="sheet.vtu", title="Trousers", observers=[rate], out=f"results/cut{cut}", overwrite=True,
                    length_scale="0.2 mm", cracks=[{"name": "cut", "points": corners, "lips": "whole"}],
                    grips=[{"boundary": "upper", "y": 0, "z": [[0, 0], [1, 0.2]]},
                           {"boundary": "right", "x": 0, "y": 0, "z": 0},
                           {"boundary": "lower", "y": 0, "z": [[0, 0], [1, -0.2]]}])
    return run.history["elastic"][-1], rate.G[-1], run


sheet = sk.grid_mesh(np.linspace(0, 3.2, 33), np.linspace(0, 1.1, 12), np.linspace(0, T, 3))
x, y, _ = sheet.points.T
sheet.point_sets = {"upper": np.flatnonzero((x == 0) & (y > 0.55)), "lower": np.flatnonzero((x == 0) & (y < 0.55))}
sk.write_mesh("sheet.vtu", sheet)
(E, G, run), (E_longer, G_longer, _) = opened(2.0), opened(2.2)
run.plot("trousers.png")
print(f"-dE/(t da) = {1e3 * (E - E_longer) / (T * 0.2):.4f} J/m^2, domain integral {500 * (G + G_longer):.4f} J/m^2")
assert abs((E - E_longer) / (T * 0.2) / ((G + G_longer) / 2) - 1) < 0.1
