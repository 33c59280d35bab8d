"""Small even blocks of quadrilaterals for the study of stability, made where they are needed."""

from __future__ import annotations

import numpy as np
import skfem

from ..fem.space import Space
from ..meshing.sample import Sample

__all__ = ["block", "surface", "trapezium"]


def block(n: int, *, notch: float = 0.0, width: float = 0.0, rounded: bool = False, distortion: float = 0.0,
          seed: int = 0) -> Sample:
    """Square of 1 mm of n x n elements with the boundaries `top`, `bottom`, `pin` (a node at
    the middle of the right side) and, if it has one, `notch`.

    The notch enters at mid-height from the left, is `notch` [mm] long and `width` [mm] wide, cut out of rows of
    elements; 0 is a slit between two of them (n even). Its end is square, or a half circle if `rounded`. `distortion`
    moves inner nodes at random by up to that part of 1/n.
    """
    across, beside = max(round(width * n), 1), max(round((1 - width) / 2 * n), 1)
    inside = 0.5 * width * np.sin(np.linspace(-0.5, 0.5, across + 1) * np.pi) if rounded else np.zeros(0)
    y_lines = np.linspace(0.0, 1.0, n + 1)
    if rounded:
        y_lines = np.concatenate([np.linspace(0, 0.5 - width / 2, beside + 1), 0.5 + inside[1:-1],
                                  np.linspace(0.5 + width / 2, 1, beside + 1)])
    mesh = skfem.MeshQuad.init_tensor(np.linspace(0.0, 1.0, n + 1), y_lines)
    p, t = mesh.p.copy(), mesh.t.copy()
    x, y = p[:, t].mean(axis=1)
    tip = (p[0] < notch + 1e-9) & (np.abs(p[1] - 0.5) < width / 2 + 1e-9)
    if notch > 0 and width > 0:
        t = t[:, ~((x < notch) & (np.abs(y - 0.5) < width / 2))]
    elif notch > 0:
        lips = np.flatnonzero(tip & (p[0] < p[0, tip].max() - 1e-9))
        double = np.arange(p.shape[1])
        double[lips] = p.shape[1] + np.arange(lips.size)
        p, tip = np.hstack([p, p[:, lips]]), np.append(tip, np.ones(lips.size, bool))
        above = y > 0.5
        t[:, above] = double[t[:, above]]
    if rounded:
        end = p[0, tip].max()
        off = np.minimum(np.abs(p[1] - 0.5), width / 2)
        back = width / 2 - np.sqrt(np.maximum((width / 2) ** 2 - off**2, 0.0))
        back *= np.exp(-(np.abs(p[1] - 0.5) - off) / (width / 2))  # which fades above and below the notch
        p[0] -= back * np.where(p[0] < end, p[0] / end, (1 - p[0]) / (1 - end))
    used = np.unique(t)
    number = np.zeros(p.shape[1], int)
    number[used] = np.arange(used.size)
    p, t = np.ascontiguousarray(p[:, used]), np.ascontiguousarray(number[t])
    inner = np.setdiff1d(np.arange(used.size), skfem.MeshQuad(p, t).boundary_nodes())
    p[:, inner] += np.random.default_rng(seed).uniform(-distortion, distortion, (2, inner.size)) / n
    sets = {"top": np.flatnonzero(np.isclose(p[1], 1.0)), "bottom": np.flatnonzero(np.isclose(p[1], 0.0))}
    sets["pin"] = np.array([np.argmin(np.hypot(p[0] - 1, p[1] - 0.5))])
    if notch > 0:
        sets["notch"] = np.flatnonzero(tip[used])
    return Sample(f"block{n}", Space(skfem.MeshQuad(p, t)), sets)


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
