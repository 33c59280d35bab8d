"""The energy release rate of a penny-shaped crack beside linear elasticity: `python cases/penny_crack/closed_form.py`.

In an infinite body under the stress s across the crack, of radius a (Sneddon 1946; in a cylinder of radius b the factor
F of Tada, Paris and Irwin multiplies K),

    G = 4 (1 - nu^2) s^2 a/(pi E) F^2,
    F = sqrt(1 - c) (1 + c/2 - 5/8 c^2 + 0.421 c^3)/(1 - c^2),   c = a/b.

The computed rate is the difference of the energies of two cracks at the same displacement over that of their areas.
With a folder it is that at the onset of the run there as well.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import skfsink
from skfsink.fields.momentum import Momentum
from skfsink.loads.grips import Grip
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, SinkLaw
from skfsink.meshing.sample import file_sample
from skfsink.methods.newton import Newton

MESHES = Path(__file__).parent / "meshes"
RADIUS = 2.0  # of the cylinder [mm]


def exact(stress: float, a: float, material: AAA) -> float:
    """G [N/mm] of linear elasticity under a `stress` [MPa] far away, for a crack of radius `a` [mm]."""
    k, mu, c = material.bulk_modulus, material.shear_modulus, a / RADIUS
    young, nu = 9 * k * mu / (3 * k + mu), (3 * k - 2 * mu) / (2 * (3 * k + mu))
    factor = np.sqrt(1 - c) * (1 + c / 2 - 5 / 8 * c**2 + 0.421 * c**3) / (1 - c**2)
    return float(4 * (1 - nu**2) * stress**2 * a / (np.pi * young) * factor**2)


def pulled(mesh: str, count: int, displacement: float, steps: int = 1) -> tuple[float, float, float]:
    """Radius of a crack of `count` elements of the middle row [mm], stored energy [N mm] and load [N] with it.

    The ends part by `displacement` [mm], in `steps`.
    """
    sample = file_sample(MESHES / f"{mesh}.vtu").revolved()
    space, material = sample.space, AAA()
    middle = space.X[space.conn].mean(axis=1)
    row = np.flatnonzero(np.abs(middle[:, 1]) < 1e-9)
    broken = row[np.argsort(middle[row, 0])][:count]
    top, bottom = sample.nodes("top"), sample.nodes("bottom")
    loading = Loading(space, [(top, Grip("top", (None, 1.0))), (bottom, Grip("bottom", (None, -1.0)))])
    momentum = Momentum(space, material, "axisymmetric")
    momentum.set_gamma(np.ones(space.n_nodes), np.isin(np.arange(space.n_elements), broken))
    newton, u, force = Newton(momentum, loading.free, 1e-7, 60), np.zeros_like(space.X), np.zeros_like(space.X)
    for part in np.linspace(0.0, 1.0, steps + 1)[1:]:
        u[top, 1], u[bottom, 1] = part * displacement / 2, -part * displacement / 2
        u, force = newton.equilibrium(u)
    return float(space.X[space.conn[broken], 0].max()), momentum.energy, float(force[top, 1].sum())


def released(mesh: str, displacement: float, radius: float = 0.5, steps: int = 1) -> tuple[float, float, float]:
    """G [N/mm] between two cracks as near to `radius` [mm] as the mesh has them, their mean radius, the load [N]."""
    across = len(np.unique(file_sample(MESHES / f"{mesh}.vtu").space.X[:, 0])) - 1
    count = round(radius * across / RADIUS - 0.5)
    (a, first, load), (b, second, other) = (pulled(mesh, n, displacement, steps) for n in (count, count + 1))
    return (first - second) / (np.pi * (b**2 - a**2)), 0.5 * (a + b), 0.5 * (load + other)


if __name__ == "__main__":
    law, material = SinkLaw(), AAA()
    for mesh in ("coarse", "fine"):
        G, a, load = released(mesh, 4e-3)
        print(f"{mesh}, strain 1e-3: G is {G / exact(load / (np.pi * RADIUS**2), a, material):.3f} of the closed form")
    for folder in sys.argv[1:]:
        run = skfsink.load(Path(folder))
        onset = run.summary["onset"]
        G, a, load = released(run.scene.sample.name, onset["displacement_mm"], steps=8)
        stress = load / (np.pi * RADIUS**2)
        print(f"{run.scene.sample.name}, at the onset: {stress:.4f} MPa far away, G {G:.4f} N/mm, "
              f"{G / (law.failure_energy * law.length_scale):.2f} psi_f l; for small strains "
              f"{exact(stress, a, material):.4f} N/mm")
