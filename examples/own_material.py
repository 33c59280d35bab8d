"""A material of your own: Demiray's exponential law of soft tissue.

One class and one compiled function. A sheet of it, in plane stress, is pulled until it is about to fail. The number:
the nominal stress of uniaxial tension, 2 psi' (s - 1/s^2), times the density that the sink has left; at k/mu = 830
the sheet is incompressible to 0.5 %.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

import skfsink as sk


@njit
def demiray(i1, c, psi, dpsi, ddpsi):
    for i in range(i1.size):
        e = np.exp(min(c[1] * (i1[i] - 3.0), 300.0))  # only points without stiffness get there
        psi[i], dpsi[i], ddpsi[i] = c[0] / c[1] * (e - 1.0), c[0] * e, c[0] * c[1] * e


@dataclass(frozen=True)
class Demiray(sk.Material):
    law = staticmethod(demiray)
    a: float = 0.3  # MPa
    b: float = 1.5

    @property
    def constants(self):
        return np.array([self.a, self.b])


tissue, sink = Demiray(), sk.SinkLaw(phi=0.5)
sk.write_mesh("sheet.vtu", sk.grid_mesh(np.linspace(0, 2, 5), np.linspace(0, 1, 3)))
scene = sk.custom.scene(mesh="sheet.vtu", element="planestress", stop="displacement > 0.9 mm", grips=[
    {"boundary": "right", "x": "1 mm/s"}, {"boundary": "bottom", "y": 0}, {"boundary": "left", "x": 0}])
sheet = sk.run_scene(replace(scene, material=tissue, sink_law=sink), "results/demiray", overwrite=True)
tissue.plot(sink).figure.savefig("own_material.png", dpi=120)

s = 1 + sheet.history["grip_displacement_mm"][-1] / 2
closed = 2 * float(tissue.isochoric(s**2 + 2 / s)[1]) * (s - 1 / s**2) * sheet.history["gamma_min"][-1]
assert abs(sheet.history["reaction_N_per_mm"][-1] / closed - 1) < 5e-3
