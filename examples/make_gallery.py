"""Runs the examples and keeps their pictures for the gallery: `python examples/make_gallery.py [NAME]`.

Each runs in a folder of its own, `results/gallery/NAME`, and leaves `NAME.png` there. The picture goes, made small, to
`docs/images/examples`, with a hash of the script that made it; a test holds the two together. Four minutes in all.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

from PIL import Image
from PIL.PngImagePlugin import PngInfo

HERE = Path(__file__).resolve().parent
PICTURES = HERE.parent / "docs" / "images" / "examples"
WIDTH, COLOURS, LARGEST = 800, 128, 100_000  # of a picture [pixels], [bytes]


def names() -> list[str]:
    """The examples, in alphabetical order."""
    return sorted(path.stem for path in HERE.glob("*.py") if path.stem != "make_gallery")


def script_hash(name: str) -> str:
    """Of the text of an example."""
    return hashlib.sha256((HERE / f"{name}.py").read_text(encoding="utf-8").encode()).hexdigest()[:16]


def keep(source: Path, name: str) -> None:
    """Make a picture small, and keep it with the hash of its script."""
    picture = Image.open(source).convert("RGB")
    picture.thumbnail((WIDTH, 2 * WIDTH), Image.Resampling.LANCZOS)
    about = PngInfo()
    about.add_text("script", script_hash(name))
    PICTURES.mkdir(parents=True, exist_ok=True)
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(PICTURES / f"{name}.png", pnginfo=about, optimize=True)
    size = (PICTURES / f"{name}.png").stat().st_size
    print(f"{name}: {size} bytes" + (f", more than {LARGEST}" if size > LARGEST else ""))


def run(name: str) -> None:
    """Run an example and keep its picture."""
    folder = HERE.parent / "results" / "gallery" / name
    folder.mkdir(parents=True, exist_ok=True)
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    subprocess.run([sys.executable, HERE / f"{name}.py"], cwd=folder, check=True, env=environment)
    keep(folder / f"{name}.png", name)


if __name__ == "__main__":
    for asked in sys.argv[1:] or names():
        run(asked)
