"""One tangent of the study of tangents, on the ranks there are: `python -m skfsink.methods.ranks FILE direct 10000`.

It prints what assembly, preparation and solutions have cost as a line of JSON.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import skfem

from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, SinkLaw
from skfsink.methods.controls import StaticsControls
from skfsink.methods.ranks.statics import NewtonInParts, statics_of
from skfsink.study.systems import crack
from skfsink.system.peak import peak_rss_mb

H = 0.05                   # of the cubes [mm]: l/2
CRACK, STRETCH = 0.4, 1.1  # of the length, the slot of 0.2 in it; of the block
TOLERANCES = (1e-2, 1e-6)  # of a Newton step, and of a solution
MOST = 1000                # iterations


def block(unknowns: int) -> Space:
    """A block of about so many unknowns, five times as long as high and thick, with a slot at mid-height."""
    n = max(2, round((unknowns / 15) ** (1 / 3)))
    shape = 5 * n, 2 * (n // 2) + 1, n
    mesh = skfem.MeshHex.init_tensor(*[H * np.arange(m + 1) for m in shape])
    x, y, _ = mesh.p[:, mesh.t].mean(axis=1)
    cells = mesh.t[:, ~((x < H * n) & (np.abs(y - H * shape[1] / 2) < H / 2))]
    used, cells = np.unique(cells, return_inverse=True)
    return Space(skfem.MeshHex(np.ascontiguousarray(mesh.p[:, used]), np.ascontiguousarray(cells.reshape(8, -1))))


def stretched(space: Space) -> tuple[Body, np.ndarray]:
    """The block with a crack from its slot on, held at top and bottom, and its displacement at 10 % of stretch.

    gamma is 1 - exp(-d/l) at the distance d of the crack, which solves the mass balance beside a straight one.
    """
    X, law = space.X, SinkLaw()
    ends = (X[:, 1] < 1e-9) | (X[:, 1] > X[:, 1].max() - 1e-9)
    momentum = Momentum(space, AAA())
    body = Body(momentum, DensitySolver(space, law, solver="jacobi"),
                Loading.steady(space, np.repeat(~ends, 3), np.zeros_like(X)))
    u = (STRETCH ** -0.5 - 1) * X
    u[:, 1] = (STRETCH - 1) * X[:, 1]
    momentum.set_gamma(np.maximum(1 - np.exp(-crack(X, CRACK) / law.length_scale), 1e-15),
                       np.zeros(space.n_elements, bool))
    return body, u


def main(linear: str, unknowns: int) -> None:
    """Solve with the tangent, and print what it has cost: wall times, and processor times of this rank [s]."""
    body, u = stretched(block(unknowns))
    newton = statics_of(body, StaticsControls(linear=linear)).newton
    crew = newton.crew if isinstance(newton, NewtonInParts) else None
    b = -newton.momentum.force(u).ravel()[newton.free]
    cost: dict[str, list[float]] = {}

    def timed(name: str, work: Callable[[], Any]) -> Any:
        wall, own = time.perf_counter(), time.process_time()
        found = work()
        cost[name] = [time.perf_counter() - wall, time.process_time() - own]
        return found

    solver = timed("once", lambda: newton.solver)
    timed("first", lambda: newton.tangent(u))
    data = timed("assembly", lambda: newton.tangent(u))
    timed("setup", lambda: solver.factorize(data))
    iterations = []
    for tolerance in TOLERANCES:
        _, count, met = timed(f"solve {tolerance:g}", partial(solver.conjugate, data, b, tolerance, MOST))
        iterations.append(count if met else None)
    print(json.dumps({"unknowns": b.size, "elements": body.space.n_elements, "cost": cost, "iterations": iterations,
                      "peaks_mb": [peak_rss_mb()] if crew is None else crew.peaks()}))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
