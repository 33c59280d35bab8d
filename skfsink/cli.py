"""Command line of a case module, made from the signature and docstring of its function."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NoReturn

from cyclopts import App
from cyclopts.exceptions import CycloptsError

from . import __version__
from .errors import SkfsinkError
from .simulate import Interrupted

__all__ = ["command"]

BAD_INPUT, INTERRUPTED = 2, 130


def command(function: Callable[..., Any], arguments: list[str] | None = None) -> NoReturn:
    """Run `function` with the command line's arguments; an error a user can cure is one line and exit status 2."""
    app = App(name=f"python -m skfsink.cases.{function.__name__}", version=__version__)
    app.default(function)
    try:
        app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except Interrupted as stop:
        _fail(str(stop), INTERRUPTED)
    except KeyboardInterrupt:
        _fail("interrupted at once; the last checkpoint stands", INTERRUPTED)
    except SkfsinkError as error:
        _fail(str(error), BAD_INPUT)
    except CycloptsError as error:
        _fail(" ".join(str(error).split()), BAD_INPUT)
    raise SystemExit(0)


def _fail(message: str, status: int) -> NoReturn:
    print(f"skfsink: {message}", file=sys.stderr)
    raise SystemExit(status)
