"""The plate with a hole against the radially symmetric solution: `python cases/biaxial_hole/closed_form.py FOLDER`.

In plane strain an incompressible body around a round hole of radius a can only move by r^2 = R^2 + c. Its stretch
around the hole is L = sqrt(1 + c/R^2), radially 1/L, and with w(L) = psi(L^2 + 1/L^2 + 1)

    s_theta - s_r = L w'(L),     s = integral from 1 to L(a) of w'(L)/(L^2 - 1) dL

is the Cauchy stress far away. The square plate of side b, whose sides move by u each, gets the area of the hole and, of
bulk modulus k, of its change of volume: (b + 2 u)^2 - b^2 = pi c + (b^2 - pi a^2) s/k.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

import skfsink
from skfsink.material import AAA, SinkLaw
from skfsink.material.homogeneous import peaks

SIDE, RADIUS = 8.0, 0.5  # [mm]
LAW = AAA()


@dataclass(frozen=True)
class Hole:
    """The solution for a material in which the rim of the hole is stretched by `stretch`."""

    stretch: float
    material: AAA = LAW

    def _energy(self, stretch: float) -> tuple[float, float]:
        """w and w' [MPa]."""
        w, slope, _ = self.material.isochoric(stretch**2 + stretch**-2 + 1)
        return float(w), float(slope) * (2 * stretch - 2 * stretch**-3)

    @property
    def energy(self) -> float:
        """Stored energy at the rim, W [MPa]."""
        return self._energy(self.stretch)[0]

    @property
    def hoop(self) -> float:
        """Cauchy stress around the hole at its rim [MPa]."""
        return self.stretch * self._energy(self.stretch)[1]

    @property
    def far(self) -> float:
        """Cauchy stress far away [MPa]."""
        return float(quad(lambda s: self._energy(s)[1] / (s**2 - 1), 1 + 1e-9, self.stretch)[0])

    @property
    def displacement(self) -> float:
        """Displacement of each side of the square plate [mm]."""
        hole = np.pi * RADIUS**2
        gain = hole * (self.stretch**2 - 1) + (SIDE**2 - hole) * self.far / self.material.bulk_modulus
        return float(np.sqrt(SIDE**2 + gain) - SIDE) / 2


def moved_by(displacement: float) -> Hole:
    """The solution where each side has moved by `displacement` [mm]."""
    return Hole(float(brentq(lambda s: Hole(s).displacement - displacement, 1 + 1e-6, 3.0)))


def stored(energy: float) -> Hole:
    """The solution with that energy at the rim [MPa]."""
    return Hole(float(brentq(lambda s: Hole(s).energy - energy, 1 + 1e-6, 3.0)))


def rim_stretch(mesh: meshio.Mesh) -> float:
    """Mean stretch of the rim, from the displacement in a frame of a run."""
    X = mesh.points[:, :2]
    rim = np.flatnonzero(np.abs(np.linalg.norm(X, axis=1) - RADIUS) < 1e-3 * RADIUS)
    rim = rim[np.argsort(np.arctan2(X[rim, 1], X[rim, 0]))]
    around = [float(np.linalg.norm(np.diff(x[rim], axis=0, append=x[rim][:1]), axis=1).sum())
              for x in (X, X + mesh.point_data["displacement"][:, :2])]
    return around[1] / around[0]


def compare(folder: Path) -> None:
    """Print what the run in `folder` has at its onset beside the solution at the same displacement."""
    run = skfsink.load(folder)
    sides = run.summary["onset"]["displacement_mm"] / 2
    hole, law = moved_by(sides), SinkLaw()
    top = peaks(hole.material, law)["plane strain"]
    frame = run.folder / "series" / "run_0000.vtu"
    moved = sides * (1 + run.scene.controls.overshoot)  # the first frame is past the onset by that
    print(f"onset: sides moved by {sides:.5f} mm; W(rim)/Phi {hole.energy / law.phi:.3f} in the solution there")
    for name, level in (("W(rim) = strength in plane strain", top.W), ("W(rim) = Phi", law.phi)):
        print(f"{name}, {level / law.phi:.3f} Phi: sides moved by {stored(level).displacement:.5f} mm")
    print(f"stretch of the rim {rim_stretch(meshio.read(frame)):.4f}, solution {moved_by(moved).stretch:.4f}")
    rows = run.history
    loading = rows["phase"] == "loading"
    for u, load in zip(rows["grip_displacement_mm"][loading] / 2, rows["reaction_N_per_mm"][loading]):
        if u > 0:
            stress = load / (SIDE + 2 * u)
            print(f"sides moved by {u:.5f} mm: stress there {stress:.4f} MPa, solution {moved_by(u).far:.4f}")
    print(f"stress around the rim over that far away: {hole.hoop / hole.far:.3f}, for small strains "
          f"{Hole(1.0001).hoop / Hole(1.0001).far:.3f}")


if __name__ == "__main__":
    compare(Path(sys.argv[1]))
