"""Fixtures shared by the tests: one distorted mesh of each kind, one plate about to break."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # threads do not outlive a fork, and tests of resuming fork

import pytest
from bodies import Fracture, at_onset, box, notched

from skfsink.fem.space import Space


@pytest.fixture(params=["quad", "hex"])
def kind(request: pytest.FixtureRequest) -> str:
    """Kind of element: every test that asks for it runs on quadrilaterals and on hexahedra."""
    return request.param


@pytest.fixture
def space(kind: str) -> Space:
    """Distorted mesh of the unit square (25 quads) or cube (64 hexes, a full tile; quads leave one partly filled)."""
    return box(kind, 5 if kind == "quad" else 4)


@pytest.fixture(scope="session")
def fracture() -> Fracture:
    """A notched plate of 219 quads just past its onset; loading takes two seconds, so it is done once."""
    return at_onset(notched(15))
