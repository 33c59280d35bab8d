"""The program `skfsink`, or `python -m skfsink`: scenes from decks, and what to do with their results."""

from __future__ import annotations

import importlib

from cyclopts import App, Group

from .cli.program import run
from .system.version import __version__

__all__ = ["main"]

COMMANDS = {"run": "run:run", "list": "cases:list_cases", "show": "show:show", "resume": "resume:resume",
            "sweep": "sweep:sweep", "watch": "watch:watch", "report": "report:report", "render": "render:render",
            "material": "material:material", "mesh": "mesh:mesh", "partition": "partition:partition"}


def main(arguments: list[str] | None = None) -> None:
    """Run the program."""
    app = App(name="skfsink", version=f"skfsink {__version__}", help=__doc__.partition(": ")[2].capitalize(),
              group_commands=Group.create_ordered("Commands"), group_parameters=Group.create_ordered("Parameters"))
    for name, place in COMMANDS.items():
        module, function = place.split(":")
        app.command(getattr(importlib.import_module(f".cli.{module}", __package__), function), name=name)
    run(app, arguments)


if __name__ == "__main__":
    main()
