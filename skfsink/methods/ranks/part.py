"""A part of a body on one rank: made from the whole on the rank that leads, and sent to the one that has it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import skfem

from ...errors import ParameterError
from ...fem.backend import BulkViscosity
from ...fem.selection import Selection
from ...fem.space import Space
from ...fields.body import Body, BodyControls
from ...fields.density import DensitySolver
from ...fields.momentum import Momentum
from ...fields.state import State
from ...loads.schedule import Loading
from ...material import Material, SinkLaw
from ...material.regions import Region, among
from ..controls import ExplicitControls
from .mpi import MPIExchange
from .parted import Parted
from .partition import Numbers, mesh_of, numbers, partition

if TYPE_CHECKING:
    from mpi4py import MPI

__all__ = ["ELEMENTAL", "NODAL", "PartOfBody", "check_parts", "parts_of", "state_of"]

#: fields of a state at the nodes, and of the elements
NODAL, ELEMENTAL = ("u", "v", "a", "gamma"), ("W_max", "deleted", "sink")


@dataclass(frozen=True)
class PartOfBody:
    """All that a rank needs to know of its part.

    Attributes
    ----------
    mesh: elements and nodes of the part, None of one that is read.   n_nodes: of the whole body.
    parted: the files it is read from, if it is.
    momentum, density: further arguments of the balances.
    """

    numbers: Numbers
    n_nodes: int
    mesh: skfem.Mesh | None
    axisymmetric: bool
    material: Material
    sink_law: SinkLaw
    regions: tuple[Region, ...]
    momentum: Mapping[str, Any]
    density: Mapping[str, Any]
    loading: Loading
    deletion: float
    controls: ExplicitControls
    parted: Parted | None = None

    def read(self, number: int) -> PartOfBody:
        """With its mesh, as part `number` of the files; ParameterError if they cannot be read."""
        if self.parted is None:
            return self
        own, mesh = self.parted.part(number)
        return replace(self, numbers=own, mesh=mesh)

    def balance(self, comm: MPI.Intracomm) -> Momentum:
        """The momentum balance of the part, which tells the others what it has to."""
        space = Space(self.mesh, self.axisymmetric, MPIExchange(comm, self.numbers, self.n_nodes))
        self.loading.on(space)
        return Momentum(space, self.material, regions=self.regions, dead=self.loading.dead,
                        followers=self.loading.followers, **self.momentum)

    def body(self, comm: MPI.Intracomm) -> Body:
        """The part as a body whose balances tell the others what they have to."""
        momentum = self.balance(comm)
        space = momentum.space
        density = DensitySolver(space, self.sink_law, regions=self.regions, solver="jacobi", **self.density)
        return Body(momentum, density, self.loading, self.deletion)


def check_parts(space: Space, loading: Loading, controls: BodyControls, subcycled: float = 0.0) -> None:
    """Refuse what cannot be computed in parts of a body (ParameterError)."""
    what = ("contact" if controls.contact else "kernels forms" if controls.kernels != "compiled"
            else "the consistent sink" if controls.sink == "consistent" else "subcycled elements" if subcycled else "")
    if what:
        raise ParameterError(f"several ranks cannot compute {what}: start it on one rank")
    none = np.zeros(0, np.int64)
    loading.of_part(Selection(none, none, space.n_elements, space.n_nodes))


def parts_of(body: Body, controls: ExplicitControls, ranks: int, parted: Parted | None = None) -> Iterator[PartOfBody]:
    """The parts of a body, one for each rank, made as they are asked for; of `parted` each rank reads its mesh.

    Raises
    ------
    ParameterError
        There are more ranks than elements, or a file of a part cannot be read.
    """
    space, momentum, density = body.space, body.momentum, body.density
    made = numbers(space.conn, partition(space.conn, ranks)) if parted is None else []
    for number in range(ranks):
        part = made[number] if parted is None else parted.numbers(number)
        mesh = mesh_of(space, part) if parted is None else None
        selection = Selection(part.elements, part.nodes, space.n_elements, space.n_nodes)
        absent = np.flatnonzero(np.isin(part.elements, density.absent))
        yield PartOfBody(
            part, space.n_nodes, mesh, space.axisymmetric, momentum.material, density.law,
            among(momentum.regions, part.elements),
            {"element": momentum.element, "force_floor": momentum.force_floor,
             "bulk_viscosity": BulkViscosity(*momentum.bulk_viscosity)},
            {"sink": density.sink, "unchanged": density.unchanged, "gradient": density.gradient, "absent": absent,
             "active_zone": density.active_zone},
            body.loading.of_part(selection), body.deletion, controls, parted)


def state_of(state: State, part: Numbers) -> State:
    """The part of a state; its log of failed elements begins anew."""
    arrays, values = state.stored()
    mine = {name: np.ascontiguousarray(arrays[name][part.nodes]) for name in NODAL}
    mine |= {name: np.ascontiguousarray(arrays[name][part.elements]) for name in ELEMENTAL if name in arrays}
    return State.restored(mine, {**values, "deletions": []})


