"""Which runs the figures are drawn from: the one list to edit.

A run is stored as the reference `cases/<case>/reference/<key>`. It is computed by its command line,
`python -m skfsink.cases.<case> <arguments> --out results/reference/<case>/<key>`. The phrases in `frames` say which
frames are kept (see `skfsink.results.reference.pick_frame`), those in `velocity` for which of them velocities are.
The run `coarse` of each case keeps its summary only, as `coarse.json`.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CASES", "COARSE", "FIGURES", "RUNS", "SCANS", "Run", "Scan", "key_of"]

COARSE = "coarse"


@dataclass(frozen=True)
class Run:
    """A run: its case, the key of its reference, its command line, and what is kept of it."""

    case: str
    key: str
    arguments: tuple[str, ...]
    frames: tuple[str, ...] = ()
    velocity: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Case and key."""
        return f"{self.case}/{self.key}"


@dataclass(frozen=True)
class Scan:
    """Runs of both analyses of one case, for `spread.csv`: names of the parameters, and their values for each run."""

    case: str
    columns: tuple[str, ...]
    points: tuple[tuple[str | float, ...], ...]


#: The cases in the order of the paper, and the mesh of each that the figures show.
CASES = {"single_edge_notch": "M4", "simple_shear": "paper", "symmetric_double_edge_notch": "paper",
         "asymmetric_double_edge_notch": "paper", "dog_bone": "paper", "cylindrical_shell": "paper"}
FLAT = ("growing", "growing * 0.8", "arrival", "end")
SLOW = ("growing", "arrival", "end")


def key_of(case: str, analysis: str) -> str:
    """Key of the run of a case that the figures show."""
    return f"{CASES[case]}-{analysis}"


def _run(case: str, analysis: str, frames: tuple[str, ...], velocity: tuple[str, ...] = (), mesh: str = "",
         extra: tuple[str, ...] = (), variant: str = "") -> Run:
    mesh = mesh or CASES[case]
    return Run(case, f"{mesh}-{analysis}{variant}", ("--mesh", mesh, "--analysis", analysis, *extra), frames, velocity)


RUNS: tuple[Run, ...] = (
    *(Run(case, COARSE, ("--mesh", "coarse", "--analysis", "both")) for case in CASES),
    *(_run("single_edge_notch", "dynamic", ("arrival", "end"), mesh=mesh) for mesh in ("M3", "M5")),
    _run("single_edge_notch", "dynamic", FLAT),
    _run("single_edge_notch", "dynamic", ("arrival", "end"), extra=("--speed", "1e-15"), variant="-1e-15"),
    _run("single_edge_notch", "quasistatic", SLOW),
    *(_run(case, analysis, FLAT if analysis == "dynamic" else SLOW)
      for case in ("simple_shear", "symmetric_double_edge_notch", "asymmetric_double_edge_notch")
      for analysis in ("dynamic", "quasistatic")),
    _run("dog_bone", "dynamic", ("growing", "arrival", "end"), velocity=("growing", "arrival")),
    _run("dog_bone", "quasistatic", ("arrival", "end")),
    _run("cylindrical_shell", "dynamic", ("growing * 0.7", "arrival", "arrival + 1e-5", "arrival + 2e-5", "end"),
         velocity=("arrival", "arrival + 1e-5", "arrival + 2e-5", "end"), extra=("--aftermath", "3e-5")),
    _run("cylindrical_shell", "quasistatic", ("arrival", "end")),
)

_BOTH = {case: tuple(f"{case}/{key_of(case, analysis)}" for analysis in ("dynamic", "quasistatic")) for case in CASES}
_SINGLE = tuple(run.name for run in RUNS if run.case == "single_edge_notch" and run.key != COARSE)
#: The scripts, and the runs that each draws from.
FIGURES: dict[str, tuple[str, ...]] = {
    "fig04_single_edge": _SINGLE,
    "fig05_simple_shear": _BOTH["simple_shear"],
    "fig06_symmetric_double_edge": _BOTH["symmetric_double_edge_notch"],
    "fig07_asymmetric_double_edge": _BOTH["asymmetric_double_edge_notch"],
    "fig08_dog_bone": _BOTH["dog_bone"],
    "fig10_cylindrical_shell": _BOTH["cylindrical_shell"],
    "fig11_quasistatic": tuple(names[1] for names in _BOTH.values()),
    "table1": tuple(name for name in _SINGLE if name.endswith("dynamic")),
    "energies": tuple(name for names in _BOTH.values() for name in names),
    "spread": (),
}

_SEEDS = tuple(range(1, 6))
#: Each is a column of `spread.png`, over the last of its parameters. Meshes other than the committed ones need gmsh.
SCANS: tuple[Scan, ...] = (
    Scan("simple_shear", ("mesh", "mesh_seed"), tuple(("M4", seed) for seed in _SEEDS)),
    Scan("symmetric_double_edge_notch", ("mesh", "mesh_seed"), tuple(("M4", seed) for seed in _SEEDS)),
    Scan("symmetric_double_edge_notch", ("mesh", "notch"), tuple(("M4", notch) for notch in (0.5, 0.625, 0.75))),
)
