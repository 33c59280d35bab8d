"""Trousers: a sheet cut into two legs, which are pulled to either side of it.

The test of Rivlin and Thomas, on a small sheet of hexahedra, loaded statically and not torn. The number: with the energy
E stored at the same opening with cuts of 2.0 and 2.2 mm, -dE/(t da) is the energy release rate G, whatever the legs
do; the domain integral around the tip must give the same. Coarse elements, and a difference over 0.2 mm: 10 %.
"""

import numpy as np

import skfsink as sk

T, H = 0.2, 0.1  # thickness, and size of the elements [mm]


class Rate(sk.Observer):
    """Energy release rate at the tip of the cut."""

    def __init__(self, tip):
        self.tip, self.G = tip, []

    def loading(self, view):
        self.G.append(sk.energy_release_rate(view.body, view.state, self.tip, [1, 0, 0], 0.5, front=[0, 0, 1]).G)


def torn(cut):
    """Stored energy [N mm] and G [N/mm] of trousers with that cut, opened by 1 mm."""
    mesh = sk.grid_mesh(np.arange(0, 3.6, H), np.linspace(0, 1.1, 12), np.linspace(0, T, 3))
    x, y, _ = mesh.points[mesh.cells_dict["hexahedron"]].mean(axis=1).T
    leg = np.flatnonzero((x > cut) | (abs(y - 0.55) > 0.04))
    used, cells = np.unique(mesh.cells_dict["hexahedron"][leg], return_inverse=True)
    points = mesh.points[used]
    mesh = type(mesh)(points, [("hexahedron", cells.reshape(-1, 8))], point_sets={
        "upper": np.flatnonzero((points[:, 0] < 1e-9) & (points[:, 1] > 0.56)),
        "lower": np.flatnonzero((points[:, 0] < 1e-9) & (points[:, 1] < 0.54))})
    sk.write_mesh("trousers.vtu", mesh)
    rate = Rate((cut, 0.55, T / 2))
    run = sk.custom(mesh="trousers.vtu", title="Trousers", observers=[rate], out=f"results/trousers{cut}", overwrite=True,
                    grips=[{"boundary": "upper", "y": 0, "z": [[0, 0], [1, 0.5]]}, {"boundary": "right", "x": 0, "y": 0, "z": 0},
                           {"boundary": "lower", "y": 0, "z": [[0, 0], [1, -0.5]]}])
    return run, run.history["elastic"][-1], rate.G[-1]


(run, one, G), (_, other, G2) = torn(2.0), torn(2.2)
run.plot("trousers.png")
released = (one - other) / (T * 0.2)
print(f"-dE/(t da) = {released:.5f} N/mm, domain integral {(G + G2) / 2:.5f} N/mm")
assert abs(released / ((G + G2) / 2) - 1) < 0.1
