"""The picture of the page of `skfsink watch`: `python docs/make/watch.py RUN` writes docs/images/watch.png.

RUN is the folder of a run that goes on. It needs the extra `test` and a browser, as the tests of the report do.
"""

from __future__ import annotations

import io
import shutil
import sys
import threading
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from skfsink.watch.page import Watch
from skfsink.watch.server import Server

TARGET = Path(__file__).resolve().parents[1] / "images" / "watch.png"
BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "chrome")
WIDTH, HEIGHT = 1200, 1330  # [pixels]


def shot(folder: Path) -> bytes:
    """The top of the page about a run, as a browser shows it when all pictures are there."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    with Server(Watch([folder]), port=0) as server, sync_playwright() as play:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        page = play.chromium.launch(executable_path=browser, args=["--no-sandbox"]).new_page(
            viewport={"width": WIDTH, "height": HEIGHT})
        page.goto(server.url, wait_until="domcontentloaded")
        while not page.evaluate("[...document.images].every(i => i.complete && i.naturalWidth > 0)"):
            page.wait_for_timeout(200)
        page.wait_for_timeout(2500)  # one look later the words of the pictures are those of what is drawn
        picture = page.screenshot()
        server.shutdown()
        return bytes(picture)


def main() -> None:
    """Write the picture."""
    Image.open(io.BytesIO(shot(Path(sys.argv[1])))).convert("RGB").save(TARGET, optimize=True)
    print(TARGET)


if __name__ == "__main__":
    main()
