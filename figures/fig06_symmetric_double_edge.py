"""Fig. 6, symmetric double-edge notched plate: geometry, cracks of both analyses on the deformed plate, and U."""

from __future__ import annotations

from pathlib import Path

from flat import plate_figure
from layout import script


def draw(path: Path) -> None:
    """Draw the figure."""
    plate_figure(path, "symmetric_double_edge_notch", early="growing * 0.8")


if __name__ == "__main__":
    script(draw, __file__)
