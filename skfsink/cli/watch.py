"""`watch`: a page about runs that go on."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

__all__ = ["watch"]


def watch(*folders: Path, port: int = 8765, host: str = "127.0.0.1",
          open_: Annotated[bool, Parameter(name="open", negative="", show_default=False)] = False) -> None:
    """Show runs that go on, or have ended, on a page of this machine that refreshes itself; Ctrl-C ends it.

    Parameters
    ----------
    folders
        Of runs and sweeps, or folders of runs; only read.
    port
        Of the page; 0 takes a free one.
    host
        Address to listen at. Any other than that of this machine itself shows the runs to whoever reaches it; from
        elsewhere an ssh tunnel does without.
    open_
        Open the page in the browser.
    """
    import sys

    from ..errors import require
    from ..watch.page import Watch
    from ..watch.server import Server

    require("port", port, low=0, high=65535, whole=True)
    with Server(Watch(folders), host, port) as server:
        if not server.local:
            print(f"skfsink: warning: whoever reaches {host} sees these runs", file=sys.stderr)
        print(server.url, flush=True)
        if open_:
            import webbrowser

            webbrowser.open(server.url)
        with suppress(KeyboardInterrupt):
            server.serve_forever()


if __name__ == "__main__":
    from .program import command

    command(watch, package="commands")
