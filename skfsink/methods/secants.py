"""Steps of Newton's method by factors of an earlier tangent, corrected by what the steps since then have shown.

Each step s that changed the residual force by y tells that the tangent takes s to about y. Of all matrices that do so,
BFGS takes the one nearest to the one before; its inverse is applied from the pairs alone (Nocedal 1980; with factors
of a tangent in statics Matthies and Strang 1979). It stays symmetric and positive definite, so that each step goes down
in energy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

__all__ = ["Secants"]


class Secants:
    """The last pairs of a step and the change of residual force in it, over the free unknowns.

    Memory: the pairs given to `add` since `clear`, which `solve` uses; `memory` gives them, `restore` takes them up.

    Parameters
    ----------
    most: pairs that are kept, 0 for none.
    """

    CURVES = 1e-8  # least s.y over |s| |y|: below, the tangent is not definite along s, or all of y is rounding

    def __init__(self, most: int) -> None:
        self.most = most
        self._pairs: list[tuple[np.ndarray, np.ndarray, float]] = []

    def clear(self) -> None:
        """Forget all pairs."""
        self._pairs = []

    def add(self, s: np.ndarray, y: np.ndarray) -> None:
        """Take a step `s` (m,) in which the residual force changed by `y` (m,)."""
        curvature = float(s @ y)
        if self.most and curvature > self.CURVES * float(np.linalg.norm(s) * np.linalg.norm(y)):
            self._pairs = [*self._pairs, (s, y, curvature)][-self.most:]

    def solve(self, apply: Callable[[np.ndarray], np.ndarray], b: np.ndarray) -> np.ndarray:
        """Step (m,) for the force `b` (m,), with what `apply` takes it to by the factors."""
        q, shares = b.copy(), []
        for s, y, curvature in reversed(self._pairs):
            share = float(s @ q) / curvature
            shares.append(share)
            q -= share * y
        d = apply(q)
        for (s, y, curvature), share in zip(self._pairs, reversed(shares)):
            d += (share - float(y @ d) / curvature) * s
        return d

    # --- checkpoints ---
    def memory(self) -> dict[str, np.ndarray]:
        """The pairs, for a checkpoint."""
        if not self._pairs:
            return {}
        return {"secant_steps": np.array([s for s, _, _ in self._pairs]),
                "secant_forces": np.array([y for _, y, _ in self._pairs])}

    def restore(self, memory: Mapping[str, np.ndarray]) -> None:
        """Take up what :meth:`memory` gave."""
        self.clear()
        if "secant_steps" in memory:
            for s, y in zip(memory["secant_steps"], memory["secant_forces"]):
                self.add(s.copy(), y.copy())
