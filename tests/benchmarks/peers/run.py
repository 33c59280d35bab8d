"""skfsink beside the libraries one would otherwise take, on the same two elastic problems, on one thread.

    python tests/benchmarks/peers/run.py --environment DIR                     # everything
    python tests/benchmarks/peers/run.py --environment DIR --peers felupe ngsolve
    python tests/benchmarks/peers/run.py --table                               # only the table, from what was measured

DIR is a virtual environment, made if it is not there; nothing is installed anywhere else. What was measured is kept
in `results/<processor>.json` and not measured again, unless `--again`; so a run that was stopped goes on. The table is
printed and written to `docs/peers.md`. Run it with nothing else on the machine.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import venv
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from problem import PROBLEMS, ROOT, make  # noqa: E402
from table import COLUMNS, markdown, put, rows  # noqa: E402

DOCUMENT = ROOT / "docs" / "peers.md"
LIMIT = 3600  # seconds a library may take for a problem
#: peers in the order of the table: module and variant, and what the table calls it
PEERS = {
    "skfsink": "skfsink",
    "skfsink:full": "skfsink, full Newton",
    "ngsolve": "NGSolve",
    "felupe:pardiso": "FElupe, PARDISO",
    "felupe": "FElupe",
    "skfem:pardiso": "scikit-fem, PARDISO",
    "skfem": "scikit-fem",
    "skfem:one-form": "scikit-fem, `skfsink.fem.forms`",
    "tatva:pardiso": "tatva, PARDISO",
    "tatva": "tatva",
    "sfepy": "SfePy",
    "skfsink:plain": "skfsink, plain element",
    "torchfem": "torch-fem",
    "easyfea": "EasyFEA",
}
#: peers that cannot state every problem, or take a quarter of an hour for it
ONLY = {"sfepy": ("slab",), "skfem:one-form": ("plate",)}
SINGLE = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


def environment(folder: Path, console: Console) -> tuple[Path, dict[str, str]]:
    """Interpreter of the environment, made and filled where needed, and what could not be installed, with the reason.

    The requirements are installed one by one, so that one that does not install keeps no other from it.
    """
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        venv.create(folder, with_pip=True)
    state = folder / "installed.json"
    done: dict[str, str] = json.loads(state.read_text()) if state.exists() else {}
    lines = [line.split("#")[0].strip() for line in (HERE / "requirements.txt").read_text().splitlines()]
    for line in [line for line in lines if line] + [f"-e {ROOT}"]:
        if done.get(line) == "":
            continue
        with console.status(f"installing {line}"):
            run = subprocess.run([python, "-m", "pip", "install", "--quiet", *line.split(maxsplit=1)],
                                 capture_output=True, text=True)
        errors = [e for e in run.stderr.splitlines() if "error" in e.lower()] or [f"pip exited with {run.returncode}"]
        done[line] = "" if run.returncode == 0 else errors[-1].strip()
        state.write_text(json.dumps(done, indent=1))
        if done[line]:
            console.print(f"not installed: {line}: {done[line]}")
    return python, {line: reason for line, reason in done.items() if reason}


def measured(python: Path, folder: Path, peer: str, problem: Path) -> dict[str, Any]:
    """Figures of one peer on one problem, from a process of its own; `error` if it failed."""
    environ = {**os.environ, **SINGLE, "NUMBA_CACHE_DIR": str(folder / "numba"), "PYTHONDONTWRITEBYTECODE": "1"}
    environ.pop("PYTHONPATH", None)
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "figures.json"
        try:
            run = subprocess.run([python, HERE / "measure.py", peer, problem, out], env=environ, capture_output=True,
                                 text=True, timeout=LIMIT, cwd=scratch)
        except subprocess.TimeoutExpired:
            return {"error": f"not done in {LIMIT} s"}
        if run.returncode != 0 or not out.exists():
            last = [line for line in run.stderr.splitlines() if line.strip()] or [f"exit status {run.returncode}"]
            return {"error": last[-1].strip()}
        figures: dict[str, Any] = json.loads(out.read_text())
        return figures


def machine() -> dict[str, Any]:
    """What the figures were measured on."""
    model, info = platform.processor(), Path("/proc/cpuinfo")
    if info.exists():
        model = next((line.split(":")[1].strip() for line in info.read_text().splitlines() if "model name" in line),
                     model)
    return {"processor": model, "cores": os.cpu_count(), "python": platform.python_version(),
            "system": platform.system(), "skfsink": version("skfsink")}


def report_path() -> Path:
    """The report of this machine."""
    stamp = machine()
    slug = "".join(c if c.isalnum() else "-" for c in f"{stamp['processor']}-{stamp['cores']}-cores")
    return HERE / "results" / f"{slug.strip('-').lower()}.json"


def show(report: dict[str, Any], console: Console, document: Path = DOCUMENT) -> None:
    """Print the tables and write them to the document."""
    for name in PROBLEMS:
        cells = rows(report["problems"].get(name, {}), PEERS)
        table = Table(*COLUMNS, title=name)
        for line in cells:
            table.add_row(*line)
        console.print(table)
        put(document, name, markdown(cells))
    stamp = report["machine"]
    versions = {package: number for results in report["problems"].values() for figures in results.values()
                for package, number in figures.get("versions", {}).items()}
    put(document, "machine", f"{stamp['processor']}, Python {stamp['python']}, skfsink {stamp['skfsink']}, "
        + ", ".join(f"{p} {versions[p]}" for p in sorted(versions)) + ".")


def main(arguments: list[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--environment", type=Path, help="virtual environment, made if it is not there")
    parser.add_argument("--peers", nargs="+", choices=list(PEERS), default=list(PEERS), metavar="PEER",
                        help=", ".join(PEERS))
    parser.add_argument("--problems", nargs="+", choices=PROBLEMS, default=PROBLEMS)
    parser.add_argument("--again", action="store_true", help="measure again what has been measured")
    parser.add_argument("--table", action="store_true", help="measure nothing")
    options = parser.parse_args(arguments)
    if not (options.table or options.environment):
        parser.error("name a folder: --environment DIR")
    console, path = Console(width=None if sys.stdout.isatty() else 180), report_path()
    report: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {"problems": {}}
    if not options.table:
        path.parent.mkdir(exist_ok=True)
        folder = options.environment.resolve()
        python, report["not_installed"] = environment(folder, console)
        report["machine"] = machine()
        for name in options.problems:
            source = folder / f"{name}.npz"
            make(name).save(source)
            results = report["problems"].setdefault(name, {})
            for peer in options.peers:
                if name not in ONLY.get(peer, PROBLEMS) or ("total_s" in results.get(peer, {}) and not options.again):
                    continue
                with console.status(f"{name}: {PEERS[peer]}"):
                    results[peer] = measured(python, folder, peer, source)
                path.write_text(json.dumps(report, indent=1) + "\n")
                figures = results[peer]
                console.print(f"{name}: {PEERS[peer]}: " + figures.get("error", f"{figures.get('total_s', 0):.2f} s")
                              + ("; others used the processor meanwhile: their caches and memory traffic count too"
                                 if figures.get("wall_s", 0) > 1.1 * figures.get("total_s", 0) else ""))
    if "machine" not in report:
        parser.error(f"nothing has been measured on this machine: there is no {path.name}")
    show(report, console)


if __name__ == "__main__":
    main()
