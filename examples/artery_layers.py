"""A tube of media and adventitia under pressure.

A tube as a body of revolution, held along its axis: the tissue of the paper inside, one twice as stiff outside. It is
pressurised until the media has lost 0.1 % of its density, and no farther. The number: pressure and gained volume are
those of two thick rings of incompressible material (examples/ring_bursts.py), with the law of each layer in its part
of the integral; eight elements through the wall leave less than 1 %.
"""

import matplotlib.pyplot as plt
import numpy as np

import skfsink as sk

length = 0.4  # of the tube [mm]
mesh = sk.grid_mesh(np.linspace(1, 1.2, 9), np.linspace(0, length, 17))
mesh.cell_sets = {"adventitia": [np.flatnonzero(mesh.points[mesh.cells_dict["quad"]].mean(axis=1)[:, 0] > 1.1)]}
sk.write_mesh("tube.vtu", mesh)
tube = sk.custom(mesh="tube.vtu", title="A tube of two layers", element="axisymmetric", out="results/tube",
                 overwrite=True, grips=[{"boundary": "bottom", "y": 0}, {"boundary": "top", "y": 0}],
                 pressures=[{"boundary": "left", "rate": "10 kPa/s"}], stop=lambda view: view.state.gamma.min() < 0.999,
                 regions=[{"name": "adventitia", "material": "aaa", "constants": "c1 = 1.234, c2 = 2.43",
                           "phi": "168.6 kPa"}],
                 probes=[{"name": "wall", "kind": "line", "position": [1.001, 0.2], "to": [1.199, 0.2], "points": 41,
                          "quantity": "stress"}])
last = -2  # increment before the sink had begun
pressure, c = tube.history["pressure_MPa"][last], tube.history["swept_volume"][last] / (np.pi * length)
wall = tube.probes["wall"]
figure, axes = plt.subplots(figsize=(5, 3), layout="constrained")
axes.plot(1.001 + wall.look("s_mm")[last], wall.look("stress_zz_MPa")[last], "k")
axes.set(xlabel="radius, undeformed (mm)", ylabel="hoop stress, means of elements (MPa)",
         title=f"pressure {1e3 * pressure:.0f} kPa")
figure.savefig("artery_layers.png", dpi=120)

R = np.linspace(1, 1.2, 2001)
s2 = 1 + c / R**2
media, adventitia = (sk.materials.aaa(c1=c1, c2=c2).isochoric(s2 + 1 / s2 + 1)[1] for c1, c2 in (
    (0.617, 1.215), (1.234, 2.43)))
closed = np.trapezoid(2 * np.where(R < 1.1, media, adventitia) * (s2 - 1 / s2) * R / (R**2 + c), R)
print(f"{pressure:.5f} MPa, closed form {closed:.5f} MPa")
assert abs(pressure / closed - 1) < 0.01
