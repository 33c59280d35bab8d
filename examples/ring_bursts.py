"""A pressurised ring bursts.

The section of an artery: inner radius 1 mm, wall 0.2 mm of the tissue of the paper, plane strain, with a weak place
at the top. The number: while nothing softens, the pressure is that of an incompressible thick ring that has swept the
area pi c, p = integral of 2 psi' (s^2 - 1/s^2) R/(R^2 + c) dR with s^2 = 1 + c/R^2. The weak place is as stiff as the
rest; three elements through the wall and k/mu = 400 leave less than 1 %.
"""

import numpy as np

import skfsink as sk


def ring(points):
    r, angle = points[:, 0], points[:, 1]
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), 0 * r])


mesh = sk.grid_mesh(np.linspace(1, 1.2, 4), np.linspace(-np.pi / 2, 1.5 * np.pi, 106), place=ring)
(x, y, _), (x0, y0, _) = mesh.points.T, mesh.points[mesh.cells_dict["quad"]].mean(axis=1).T
mesh.point_sets = {"inner": np.flatnonzero(np.hypot(x, y) < 1.001), "below": np.flatnonzero((abs(x) < 1e-9) & (y < 0)),
                   "foot": np.flatnonzero(y < -1.1999)}
mesh.cell_sets = {"weak": [np.flatnonzero((y0 > 0) & (abs(x0) < 0.1))]}
sk.write_mesh("ring.vtu", mesh)
burst = sk.custom(mesh="ring.vtu", merge_nodes=1e-6, title="A ring bursts", out="results/ring", overwrite=True,
                  grips=[{"boundary": "below", "x": 0}, {"boundary": "foot", "y": 0}],
                  pressures=[{"boundary": "inner", "rate": "10 kPa/s", "in_crack": True}], event_time="60 us",
                  regions=[{"name": "weak", "material": "aaa", "phi": "0.1 MPa"}])
burst.plot("ring_bursts.png")

whole = [i for i, gamma in enumerate(burst.history["gamma_min"]) if gamma > 0.999 and burst.history["step"][i] > 0][-1]
pressure, c = burst.history["pressure_MPa"][whole], burst.history["swept_volume"][whole] / np.pi
R = np.linspace(1, 1.2, 2001)
s2 = 1 + c / R**2
law = sk.materials.aaa().isochoric(s2 + 1 / s2 + 1)[1]
closed = np.trapezoid(2 * law * (s2 - 1 / s2) * R / (R**2 + c), R)
print(f"{pressure:.5f} MPa, closed form {closed:.5f} MPa; {burst.verdict}")
assert abs(pressure / closed - 1) < 0.01
