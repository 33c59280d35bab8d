"""A tube of media and adventitia under pressure.

A tube as a body of revolution, held along its axis: the tissue of the paper inside, one twice as stiff outside. It is
pressurised until the media has lost 1 % of its density, and no farther. The number: pressure and gained volume are
those of two thick rings of incompressible material, the integral of examples/ring_bursts.py with the law of each layer;
four elements through the wall leave less than 1 %.
"""

import numpy as np

import skfsink as sk

R, L = np.linspace(1, 1.2, 9), 0.4
mesh = sk.grid_mesh(R, np.linspace(0, L, 17))
x = mesh.points[mesh.cells_dict["quad"]].mean(axis=1)[:, 0]
mesh.cell_sets = {"adventitia": [np.flatnonzero(x > 1.1)]}
sk.write_mesh("tube.vtu", mesh)
tube = sk.custom(mesh="tube.vtu", title="A tube of two layers", element="axisymmetric", out="results/tube",
                 overwrite=True, grips=[{"boundary": "bottom", "y": 0}, {"boundary": "top", "y": 0}],
                 pressures=[{"boundary": "left", "rate": "10 kPa/s"}],
                 regions=[{"name": "adventitia", "material": "aaa", "constants": "c1 = 1.234, c2 = 2.43"}],
                 probes=[{"name": "wall", "kind": "line", "position": [1.0, 0.2], "to": [1.2, 0.2], "points": 41,
                          "quantity": "stress"}],
                 stop=lambda view: view.state.gamma.min() < 0.99)
wall, row = tube.probes["wall"], -1
hoop = wall.look("stress_zz_MPa")[-1]
import matplotlib.pyplot as plt  # noqa: E402

figure, axes = plt.subplots(figsize=(5, 3), layout="constrained")
axes.plot(wall.look("s_mm")[-1] + 1, hoop, "k")
axes.set(xlabel="radius, undeformed (mm)", ylabel="hoop stress (MPa)", title=f"p = {tube.history['pressure_MPa'][-1]:.4f} MPa")
figure.savefig("artery_layers.png", dpi=150)

c = tube.history["swept_volume"][-1] / (np.pi * L)
s = np.linspace(1, 1.2, 2001)
s2, softer = 1 + c / s**2, s < 1.1
media, adventitia = (law.isochoric(s2 + 1 / s2 + 1)[1] for law in (sk.materials.aaa(), sk.materials.aaa(c1=1.234, c2=2.43)))
closed = np.trapezoid(2 * np.where(softer, media, adventitia) * (s2 - 1 / s2) * s / (s**2 + c), s)
pressure = tube.history["pressure_MPa"][-1]
print(f"{pressure:.5f} MPa, closed form {closed:.5f} MPa; {tube.verdict}")
assert abs(pressure / closed - 1) < 0.01
