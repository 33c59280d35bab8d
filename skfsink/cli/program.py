"""Command line of a case or study module, made from the signature and docstring of its function."""

from __future__ import annotations

import inspect
import os
import signal
import sys
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any, NoReturn

from cyclopts import App, ArgumentCollection, Group
from cyclopts.exceptions import CycloptsError, UnknownCommandError

from ..errors import Interrupted, SkfsinkError
from ..methods.ranks.world import on_all_ranks
from ..system.version import __version__

__all__ = ["command", "run"]

UNEXPECTED, BAD_INPUT, INTERRUPTED = 1, 2, 130


def command(function: Callable[..., Any], arguments: list[str] | None = None, package: str = "cases") -> NoReturn:
    """Run `function` with the command line's arguments; an error a user can cure is one line and exit status 2.

    `package` is the one whose module of the same name the function is called by: "cases" or "study".
    """
    given_names: set[str] = set()

    def note(app: App, commands: tuple[str, ...], found: ArgumentCollection) -> None:
        given_names.update(argument.name.lstrip("-").replace("-", "_") for argument in found if argument.tokens)

    app = App(name=f"python -m skfsink.{package}.{function.__name__}", version=f"skfsink {__version__}", config=note,
              group_commands=Group.create_ordered("Help"))
    app.default(inspect.unwrap(function))  # a case takes `options` here, and no option as a keyword of its own
    run(app, arguments, given_names)


def run(app: App, arguments: list[str] | None, given_names: Collection[str] = ()) -> NoReturn:
    """Call what the `arguments` ask of `app`, and end the program; see :func:`command`.

    `given_names` of options, complete when the call is made, go into the options of a case.
    """
    on_all_ranks(lambda: _run(app, arguments, given_names))


def _run(app: App, arguments: list[str] | None, given_names: Collection[str]) -> NoReturn:
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends a run as Ctrl-C does
    try:
        call, bound, _ = app.parse_args(arguments, exit_on_error=False, print_error=False)
        if "options" in bound.arguments:
            bound.arguments["options"] = replace(bound.arguments["options"], given_names=frozenset(given_names))
        call(*bound.args, **bound.kwargs)
    except Interrupted as stop:
        _fail(str(stop), INTERRUPTED)
    except KeyboardInterrupt:
        _fail("interrupted", INTERRUPTED)
    except UnknownCommandError as error:
        known = ", ".join(name for name in app if not name.startswith("-"))
        _fail(f"command must be one of {known}; got {(error.unused_tokens or [''])[0]!r}", BAD_INPUT)
    except (SkfsinkError, CycloptsError) as error:
        _fail(str(error), BAD_INPUT)
    except Exception as error:  # such as the overflow of an absurd parameter, or a mistake in the program
        if "SKFSINK_DEBUG" in os.environ:
            raise
        first = (str(error).splitlines() or [""])[0]
        _fail(f"{type(error).__name__}: {first} (the environment variable SKFSINK_DEBUG shows where)", UNEXPECTED)
    raise SystemExit(0)


def _fail(message: str, status: int) -> NoReturn:
    print("skfsink:", " ".join(message.split()), file=sys.stderr)
    raise SystemExit(status)
