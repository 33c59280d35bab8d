"""Fixtures shared by the tests: distorted meshes, a plate about to break, its mesh file, and pictures on demand."""

from __future__ import annotations

import os
import shutil

os.environ.setdefault("OMP_NUM_THREADS", "1")  # threads do not outlive a fork, and tests of resuming fork

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from bodies import Fracture, at_onset, box, notched
from plates import drawing, plate

from skfsink.fem.space import Space
from skfsink.meshing.vtu import write_mesh

BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "chrome")


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


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    """Mesh file of the small plate, `plate.vtu` in the folder of the test."""
    write_mesh(tmp_path / "plate.vtu", plate())
    return tmp_path / "plate.vtu"


@pytest.fixture(scope="session", autouse=True)
def no_pictures() -> Iterator[None]:
    """Runs within the process of the tests draw nothing: pictures take longer than runs of small bodies."""
    with drawing(False):
        yield


@pytest.fixture
def pictures() -> Iterator[None]:
    """Runs draw their pictures in this test."""
    with drawing(True):
        yield


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless browser without a network."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f"no browser is installed: none of {', '.join(BROWSERS)}")
    with api.sync_playwright() as play:
        started = play.chromium.launch(executable_path=found, args=[
            "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
            "--disable-component-update", "--disable-sync"])
        yield started
        started.close()
