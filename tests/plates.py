"""A small notched plate, and runs of it by the command line: in this process, or in one that is killed."""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import traceback
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from skfsink.__main__ import main
from skfsink.cases.single_edge_notch import single_edge_notch
from skfsink.cli.program import command
from skfsink.meshing.sample import Sample, file_sample
from skfsink.meshing.vtu import write_mesh
from skfsink.results.status import STATUS
from skfsink.run import compute
from skfsink.system.files import HIDDEN

os.environ["SKFSINK_DEBUG"] = "1"  # what should not happen is a traceback then
DRAW = {name: getattr(compute, name) for name in ("draw_run", "draw_comparison", "draw_what_there_is")}
SMALL = ["--length-scale", "0.6", "--hht-dt", "5e-7", "--quiet"]  # for the elements of 0.3 mm of `plate()`


def plate(n: int = 13, side: float = 4.0, notch: float = 1.0) -> meshio.Mesh:
    """Square plate of n x n slightly distorted quads (n odd) without those of the middle row up to x = `notch`."""
    x, y = np.meshgrid(*[np.linspace(0, side, n + 1)] * 2, indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    quads = first[:, None] + np.array([0, n + 1, n + 2, 1])
    middle = points[quads].mean(axis=1)
    quads = quads[(middle[:, 0] > notch) | (np.abs(middle[:, 1] - side / 2) > 0.51 * side / n)]
    used, quads = np.unique(quads, return_inverse=True)
    points, quads = points[used], quads.reshape(-1, 4)
    edges, count = np.unique(np.sort(quads[:, [[0, 1], [1, 2], [2, 3], [3, 0]]].reshape(-1, 2), axis=1), axis=0,
                             return_counts=True)
    lines = edges[count == 1]
    x, y, _ = points[lines].mean(axis=1).T
    sets = {"top": y == side, "bottom": y == 0, "left": x == 0, "right": x == side}
    sets["notch"] = ~np.any([*sets.values()], axis=0)
    inside = np.setdiff1d(np.arange(len(points)), lines)
    points[inside, :2] += np.random.default_rng(0).uniform(-0.2, 0.2, (len(inside), 2)) * side / n
    return meshio.Mesh(points, [("quad", quads), ("line", lines)],
                       cell_sets={name: [np.zeros(0, int), np.flatnonzero(mask)] for name, mask in sets.items()})


def sample_of(folder: Path, mesh: meshio.Mesh) -> Sample:
    """The sample of a mesh that is written to `plate.vtu` in a folder, and read."""
    write_mesh(folder / "plate.vtu", mesh)
    return file_sample(folder / "plate.vtu")


def same(one: Sample, two: Sample) -> bool:
    """Whether two samples are the same numbers, of which the same bytes of results follow."""
    return (one.space.X.tobytes() == two.space.X.tobytes() and np.array_equal(one.space.conn, two.space.conn)
            and all(a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)
                    for a, b in ((one.boundaries, two.boundaries), (one.cells, two.cells))))


def deck(folder: Path, text: str) -> Path:
    """File of a deck in a folder."""
    path = folder / "deck.toml"
    path.write_text(text, encoding="utf-8")
    return path


def invoke(*arguments: object) -> tuple[Any, str, str]:
    """Exit status, stderr and stdout of the case's command line; an exception it lets through is the caller's."""
    return _called(partial(command, single_edge_notch), arguments)


def invoke_program(*arguments: object) -> tuple[Any, str, str]:
    """The same of the program `skfsink`."""
    return _called(main, arguments)


def _called(program: Callable[[list[str]], Any], arguments: Sequence[object]) -> tuple[Any, str, str]:
    out, err, handler = io.StringIO(), io.StringIO(), signal.getsignal(signal.SIGTERM)
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            program([str(a) for a in arguments])
        except SystemExit as end:
            return end.code, err.getvalue(), out.getvalue()
        finally:
            signal.signal(signal.SIGTERM, handler)
    raise AssertionError("a command line ends the program")


def forked(arguments: Sequence[object], stop: int = 0, number: signal.Signals = signal.SIGKILL) -> tuple[int, str]:
    """Exit status and stderr of the command line in a child process.

    The child sends itself the signal `number` at the `stop`-th operation on a file (0: never): before a sync, a
    replacement or a removal, and between the two syncs that a replacement takes. What is done with `status.json` does
    not count.
    """
    read, write = os.pipe()
    if (child := os.fork()) == 0:
        status, text, done = 99, "", 0
        signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have had it ignored

        def counted(operation: Any) -> Any:
            def wrapper(*args: Any, **kwargs: Any) -> Any:
                nonlocal done
                if any(STATUS in str(arg) for arg in args):  # which hangs on the clock
                    return operation(*args, **kwargs)
                done += 1
                if done == stop:
                    os.kill(os.getpid(), number)
                return operation(*args, **kwargs)
            return wrapper

        for name in ("fsync", "replace", "unlink"):
            setattr(os, name, counted(getattr(os, name)))
        try:
            status, text, _ = invoke(*arguments)
        except BaseException:
            text = traceback.format_exc()
        os.write(write, text.encode()[:60000])
        os._exit(status)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        text = pipe.read().decode()
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), text


@contextlib.contextmanager
def drawing(draws: bool) -> Iterator[None]:
    """Whether runs within this process draw their pictures."""
    with pytest.MonkeyPatch.context() as patch:
        for name, draw in DRAW.items():
            patch.setattr(compute, name, draw if draws else lambda *_: None)
        yield


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder; without those of the lock where a system has no `fcntl`: a stale one goes there."""
    left_out = () if find_spec("fcntl") else HIDDEN
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*"))
            if p.is_file() and p.name not in left_out}


def figures(folder: Path) -> dict[str, Any]:
    """The summary of a run without what depends on the machine."""
    summary: dict[str, Any] = json.loads((folder / "summary.json").read_text())
    for part in (summary, summary.get("dynamic", {}), summary.get("quasistatic", {})):
        part.pop("cost", None), part.pop("versions", None)
    return summary
