"""Small even blocks of quadrilaterals for the study of stability, made where they are needed."""

from __future__ import annotations

import numpy as np
import skfem

from ..sample import Sample
from ..space import Space

__all__ = ["block", "surface", "trapezium"]


def block(n: int, *, notch: float = 0.0, width: float = 0.0, distortion: float = 0.0, seed: int = 0) -> Sample:
    """Square of 1 mm of n x n elements with the boundaries `top`, `bottom` and, if it has one, `notch`.

    The notch enters at mid-height from the left, is `notch` [mm] long and `width` [mm] wide, cut out of the elements;
    0 is a slit between two rows of them (n even). `distortion` moves inner nodes at random by up to that part of h.
    """
    line = np.linspace(0.0, 1.0, n + 1)
    mesh = skfem.MeshQuad.init_tensor(line, line)
    p, t = mesh.p.copy(), mesh.t.copy()
    x, y = p[:, t].mean(axis=1)
    tip = np.zeros(p.shape[1], bool)
    if notch > 0 and width > 0:
        t = t[:, ~((x < notch) & (np.abs(y - 0.5) < width / 2))]
        tip = (p[0] < notch + 1e-9) & (np.abs(p[1] - 0.5) < width / 2 + 1e-9)
    elif notch > 0:
        tip = (p[0] < notch + 1e-9) & np.isclose(p[1], 0.5)
        lips = np.flatnonzero(tip & (p[0] < notch - 1e-9))
        double = np.arange(p.shape[1])
        double[lips] = p.shape[1] + np.arange(lips.size)
        p = np.hstack([p, p[:, lips]])
        above = y > 0.5
        t[:, above] = double[t[:, above]]
        tip = np.append(tip, np.ones(lips.size, bool))
    used = np.unique(t)
    number = np.zeros(p.shape[1], int)
    number[used] = np.arange(used.size)
    mesh = skfem.MeshQuad(np.ascontiguousarray(p[:, used]), np.ascontiguousarray(number[t]))
    inner = np.setdiff1d(np.arange(used.size), mesh.boundary_nodes())
    moved = mesh.p.copy()
    moved[:, inner] += np.random.default_rng(seed).uniform(-distortion, distortion, (2, inner.size)) / n
    X = moved[1]
    sets = {"top": np.flatnonzero(np.isclose(X, 1.0)), "bottom": np.flatnonzero(np.isclose(X, 0.0))}
    if notch > 0:
        sets["notch"] = np.flatnonzero(tip[used])
    return Sample(f"block{n}", Space(skfem.MeshQuad(moved, mesh.t)), sets)


def trapezium(n: int) -> Space:
    """Cook's membrane, n x n elements: 48 mm long, from 44 mm high at x = 0 to 16 mm at x = 48."""
    line = np.linspace(0.0, 1.0, n + 1)
    mesh = skfem.MeshQuad.init_tensor(line, line)
    x, y = mesh.p
    return Space(skfem.MeshQuad(np.array([48 * x, 44 * x + y * (44 - 28 * x)]), mesh.t))


def surface(space: Space) -> np.ndarray:
    """Mask (n,) of the nodes on the surface."""
    mask = np.zeros(space.n_nodes, bool)
    mask[space.mesh.boundary_nodes()] = True
    return mask
