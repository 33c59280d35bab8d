"""Which runs the figures are drawn from: the one list to edit.

A run is stored as the reference `cases/<case>/reference/<key>`. It is computed by its command line,
`python -m skfsink.cases.<case> <arguments> --out results/reference/<case>/<key>`. The phrases in `frames` say which
frames are kept (see `skfsink.results.reference.pick_frame`), those in `velocity` for which of them velocities are.
The run `coarse` of each case keeps its summary only, as `coarse.json`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

__all__ = ["CASES", "COARSE", "FIGURES", "FRONTS", "OVERDAMPED", "RUNS", "SCANS", "TRIED", "Run", "Scan", "key_of"]

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
    """Runs of one case, for `spread.csv`: names of the parameters, and their values for each run."""

    case: str
    columns: tuple[str, ...]
    points: tuple[tuple[str | float, ...], ...]
    analysis: str = "both"


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
}

_SEEDS, _THREE = tuple(range(10)), tuple(range(3))


def _over(case: str, names: tuple[str, ...], sets: Iterable[tuple[str | float, ...]], seeds: tuple[int, ...],
          analysis: str = "both") -> Scan:
    """The sets of values of the parameters `names`, each on meshes of several seeds."""
    return Scan(case, (*names, "mesh_seed"), tuple((*values, seed) for values in sets for seed in seeds), analysis)


#: Each is a column of `spread.png` and rows of `spread.md`. Meshes other than the committed ones need gmsh.
SCANS: tuple[Scan, ...] = tuple(_over(case, ("mesh",), ((mesh,),), _SEEDS) for case, mesh in (
    ("single_edge_notch", "M4"), ("simple_shear", "M4"), ("symmetric_double_edge_notch", "M4"),
    ("asymmetric_double_edge_notch", "M4")))
#: Rows of `front.md`, and points of `front.png`: how many points a quasi-static pass fails, at two element sizes.
FRONTS: tuple[Scan, ...] = tuple(
    Scan(case, ("mesh", "front"), tuple((mesh, front) for mesh in meshes for front in (0.0, 0.5, 0.8, 0.9, 0.95, 1.0)),
         "quasistatic")
    for case, meshes in (("single_edge_notch", ("coarse", "M3")), ("simple_shear", ("coarse", "M4")),
                         ("symmetric_double_edge_notch", ("mirror", "coarse")),
                         ("asymmetric_double_edge_notch", ("coarse", "M3"))))
#: The same limit by motion: events with so much viscosity that the crack creeps, while the grips go on moving; rows of
#: `front.md` as well. Viscosities in MPa s, speeds of a grip in mm/s.
OVERDAMPED = Scan("single_edge_notch", (
    "mesh", "integrator", "viscosity", "speed", "hht_dt", "event_time", "frame_every"),
    tuple(("coarse", "hht", viscosity, speed, step, 0.02, 1e-3)
          for viscosity, speed, step in ((2e-5, 10.0, 2e-6), (2e-5, 40.0, 2e-6), (5e-6, 40.0, 1e-6))), "dynamic")
#: The dimensions that the paper does not print, as they were tried: rows of `dimensions.md`.
TRIED: tuple[Scan, ...] = (
    _over("single_edge_notch", ("mesh", "notch"),
          ((mesh, notch) for notch in (1.25, 1.5, 1.75) for mesh in ("M3", "M4")), _THREE, "dynamic"),
    _over("symmetric_double_edge_notch", ("mesh", "notch"), (("M4", 0.4), ("M4", 0.6)), _THREE),
    _over("asymmetric_double_edge_notch", ("mesh", "side", "notch", "offset"), (
        ("M3", 4.0, 0.6, 1.0), ("M3", 5.0, 1.0, 1.25), ("M3", 5.0, 0.6, 1.5), ("M3", 5.0, 0.5, 1.25)), _THREE[:1],
          "dynamic"),
)
