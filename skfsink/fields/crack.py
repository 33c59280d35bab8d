"""Where the crack is: tips, branches, speeds, first arrival at a free edge, separation.

Definitions, the same for every scene and used everywhere:

cracked      nodes with gamma < 0.1.
origin       the nodes that cracked first in a connected piece of the cracked set; a piece keeps its origins when
             pieces merge.
branches     The cracked set is cut into strips of width l by the graph distance from the origins. The pieces of
             neighbouring strips that touch are linked; pieces with nothing beyond them are ends. Ends nearer than
             2.5 l to the fork they come from are roughness of the crack's face, not branches. What is left counts.
tip          the farthest node of an end. It is active while it is younger than 5 l/c_s, arrested after that; in a
             quasi-static run, whose clock counts passes and no seconds, while it is younger than 10 passes.
leading tip  the tip farthest, in a straight line, from the middle of its origin; that distance is the crack length.
tip speed    slope of the line fitted by least squares to the crack length over the last 4 l/c_s; 0 in passes.
mean speed   crack length gained between its first passing l and the first arrival, over the time that took; none in
             passes.
first arrival  a connected piece of the cracked set touches the rim of the sample at two places, more than 3 l apart,
             or, in the plane, more than 10 l on the way along the rim, as through a thin wall: the crack has reached
             an edge, a grip or another notch, or has met the crack that came from there. The rim is the outer
             boundary, in three dimensions without the surfaces along which a crack runs; a place is a set of cracked
             nodes of the rim joined by edges of elements along it. A plane of symmetry is no part of the rim: there
             the body goes on as its image, and a piece that touches the plane has the images of its places too.
separation   no path of uncracked nodes joins two grips.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial.distance import cdist

from ..fem.space import Space

__all__ = ["CRACKED", "CrackTracker", "Plane", "Tips"]

CRACKED = 0.1
NODES = 8192     # whose distances to their neighbours are made at a time
AROUND = 10.0   # lengths l along the rim of a plane body, from which on two places of it are not those of one notch
ADVANCES = 10   # passes within which a tip that advances has cracked a node


@dataclass(frozen=True)
class Tips:
    """The crack at one time.

    Attributes
    ----------
    position: of the leading tip [mm], (dim,); NaN while nothing is cracked.
    length: crack length [mm].   speed: of the leading tip [m/s].
    branches: number of ends.   active: ends that still advance.   points: all tips (branches, dim).
    nodes: where they are, (branches,).
    """

    position: np.ndarray
    length: float
    speed: float
    branches: int
    active: int
    points: np.ndarray
    nodes: np.ndarray


class Plane(NamedTuple):
    """A plane of symmetry: the axis that is normal to it, or else its unit normal (dim,), and its nodes."""

    axis: int | np.ndarray
    nodes: np.ndarray

    def height(self, x: np.ndarray, origin: np.ndarray) -> np.ndarray:
        """Distance of points x (k, dim) from the plane through `origin` (dim,), (k,) [mm]."""
        if isinstance(self.axis, np.ndarray):
            return np.abs((x - origin) @ self.axis)
        distance: np.ndarray = np.abs(x[:, self.axis] - origin[self.axis])
        return distance

    def within(self, vector: np.ndarray) -> np.ndarray:
        """The part of a vector (dim,) in the plane."""
        normal = self.axis if isinstance(self.axis, np.ndarray) else np.eye(vector.size)[self.axis]
        part: np.ndarray = vector - (vector @ normal) * normal
        return part


class CrackTracker:
    """Follows the crack through the nodal density, one call a record.

    Memory: when each node cracked, the origins and the records so far; `mark`, `look`, `nothing`, `mean_speed`,
    `advances`, `backwards` and `memory` tell of the crack up to now. Times must not go back.

    Parameters
    ----------
    space: the spaces.
    length_scale: l [mm].   shear_wave_speed: c_s [m/s]; None if times are numbers of passes.
    grips: node numbers of each grip.
    rim: node numbers of the rim.
    planes: of symmetry.
    before: mask of the nodes that are cracked from the start, (n,): they are no part of the crack, as if the mesh
        lacked them, and the nodes beside them are of the rim.
    gone: numbers of elements that the mesh has and the body has not; they join nothing, their nodes are of the rim.
    """

    _REMEMBERED = ("arrival_length", "max_branches", "separated")

    def __init__(self, space: Space, length_scale: float, shear_wave_speed: float | None, grips: list[np.ndarray],
                 rim: np.ndarray, planes: Sequence[Plane] = (), before: np.ndarray | None = None,
                 gone: np.ndarray | None = None) -> None:
        self.space, self.l = space, length_scale
        #: l/c_s [s]; None if the clock counts passes
        self._transit = None if shear_wave_speed is None else length_scale / (shear_wave_speed * 1e3)
        self._grips, self._rim, self._planes = grips, rim, planes
        self._graph = _ways(space)
        self._before = None
        if before is not None and gone is not None and gone.size:
            beside = self._graph @ before.astype(float) > 0.0
            beside[space.conn[gone]] = True
            self._before, self._rim = before, np.union1d(rim, np.flatnonzero(beside & ~before))
            self._graph = _without(self._graph, space, gone)
        self.cracked_at = np.full(space.n_nodes, np.inf)   #: time at which each node cracked [s, or pass]
        self.origin = np.full(space.n_nodes, -1)           #: number of the origin a node belongs to, -1 for none
        self.track: list[tuple[float, float]] = []         #: (time, crack length) of the records
        self.arrival: float | None = None                  #: time of the first arrival [s, or pass]
        self.arrival_length = np.nan
        self.max_branches = 0
        self.separated = False

    # --- every density update ---
    def mark(self, time: float, gamma: np.ndarray) -> bool:
        """Note nodes that cracked since the last call; True if that makes the first arrival."""
        new = (gamma < CRACKED) & np.isinf(self.cracked_at)
        if self._before is not None:
            new &= ~self._before
        if not new.any():
            return False
        self.cracked_at[new] = time
        if self.arrival is None and self._crosses():
            self.arrival = time
            return True
        return False

    def _crosses(self) -> bool:
        """Whether a piece of the cracked set joins two places of the rim."""
        rim = self._rim[np.isfinite(self.cracked_at[self._rim])]
        count, place = connected_components(self._graph[rim][:, rim], directed=False)
        if count < 2 - bool(self._planes):
            return False
        nodes = np.flatnonzero(np.isfinite(self.cracked_at))
        _, label = connected_components(self._graph[nodes][:, nodes], directed=False)
        piece, X = label[np.searchsorted(nodes, rim)], self.space.X[rim]
        for k in range(1, count):
            here = place == k
            rivals = (place < k) & (piece == piece[here][0])
            if rivals.any() and (cdist(X[here], X[rivals]).min() > 3 * self.l or self._around(rim[here], rim[rivals])):
                return True
        return any(self._meets_its_image(plane, rim, place, piece, nodes, label) for plane in self._planes)

    def _around(self, one: np.ndarray, other: np.ndarray) -> bool:
        """Whether the way along the rim of a plane body from nodes to others is longer than :data:`AROUND` l."""
        if self.space.dim == 3:
            return False
        along = self._graph[self._rim][:, self._rim]
        place = np.full(self.space.n_nodes, -1)
        place[self._rim] = np.arange(self._rim.size)
        way = dijkstra(along, directed=False, indices=place[one], min_only=True, limit=AROUND * self.l)
        return bool(np.isinf(way[place[other]]).all())

    def _meets_its_image(self, plane: Plane, rim: np.ndarray, place: np.ndarray, piece: np.ndarray, nodes: np.ndarray,
                         label: np.ndarray) -> bool:
        """Whether a piece of the cracked set (`label` of its `nodes`) joins a place of the rim to the image of it."""
        touching = np.unique(label[np.isin(nodes, plane.nodes)])
        height = plane.height(self.space.X[rim], self.space.X[plane.nodes[0]])
        height[np.isin(rim, plane.nodes)] = 0.0
        lowest = np.full(int(place.max(initial=-1)) + 1, np.inf)
        np.minimum.at(lowest, place, height)
        return bool((np.isin(piece, touching) & (2 * lowest[place] > 3 * self.l)).any())

    # --- every record ---
    def look(self, time: float, gamma: np.ndarray) -> Tips:
        """The crack now. Call :meth:`mark` first."""
        nodes = np.flatnonzero(np.isfinite(self.cracked_at))
        dim = self.space.dim
        if nodes.size == 0:
            self.track.append((time, 0.0))
            return Tips(np.full(dim, np.nan), 0.0, 0.0, 0, 0, np.empty((0, dim)), nodes)
        graph = self._graph[nodes][:, nodes]
        self._find_origins(nodes, graph)
        owner = self.origin[nodes]
        sources = np.flatnonzero(owner >= 0)
        distance, _, nearest = dijkstra(graph, directed=False, indices=sources, min_only=True,
                                        return_predecessors=True)
        ends = self._ends(graph, distance)
        X = self.space.X[nodes]
        root = owner[np.where(nearest >= 0, nearest, 0)]
        middles = {k: X[owner == k].mean(axis=0) for k in np.unique(owner[sources])}
        tips = np.array([X[e] for e in ends])
        lengths = np.array([np.linalg.norm(X[e] - middles[root[e]]) for e in ends])
        lead = int(np.argmax(lengths))
        self.track.append((time, float(lengths[lead])))
        self.max_branches = max(self.max_branches, len(ends))
        if self.arrival is not None and np.isnan(self.arrival_length):
            self.arrival_length = float(lengths[lead])
        self.separated = self.separated or self._apart(gamma)
        return Tips(tips[lead], float(lengths[lead]), self._speed(), len(ends),
                    int(self.advances(time, nodes[ends]).sum()), tips, nodes[ends])

    def advances(self, time: float, nodes: np.ndarray) -> np.ndarray:
        """Mask of the tips at `nodes` (m,) that still advance."""
        mask: np.ndarray = time - self.cracked_at[nodes] < (ADVANCES if self._transit is None else 5 * self._transit)
        return mask

    def backwards(self, node: int, within: float) -> np.ndarray | None:
        """Unit vector (dim,) from the tip at a node back along its crack, as far as `within` [mm]; None if it has none.

        It points to the mean of what cracked before, in the same ball.
        """
        X, at = self.space.X, self.cracked_at
        way = X - X[node]
        near = (np.einsum("ni,ni->n", way, way) <= within**2) & (at <= at[node])
        back: np.ndarray = way[near].mean(axis=0)
        length = float(np.linalg.norm(back))
        return back / length if length > 0.1 * within else None

    def mean_speed(self) -> float | None:
        """Mean speed of the leading tip up to the first arrival, or to the last record before any [m/s]; None where
        there is none, as in passes."""
        if self._transit is None:
            return None
        track = np.array(self.track)
        started = track[:, 1] > self.l if len(track) else np.zeros(0, bool)
        if not started.any():
            return None
        first = track[np.argmax(started)]
        if self.arrival is not None and np.isfinite(self.arrival_length):
            last = np.array([self.arrival, self.arrival_length])
        else:
            last = track[-1]
        if last[0] <= first[0]:
            return None
        return float((last[1] - first[1]) / (last[0] - first[0])) * 1e-3

    def _speed(self) -> float:
        if self._transit is None:
            return 0.0
        window = [(t, x) for t, x in self.track if t >= self.track[-1][0] - 4 * self._transit]
        if len(window) < 3 or window[-1][0] <= window[0][0]:
            return 0.0
        t, x = np.array(window).T
        return float(np.polyfit(t - t[0], x, 1)[0]) * 1e-3

    def _find_origins(self, nodes: np.ndarray, graph: csr_array) -> None:
        count, label = connected_components(graph, directed=False)
        for k in range(count):
            piece = nodes[label == k]
            if (self.origin[piece] >= 0).any():
                continue
            times = self.cracked_at[piece]
            self.origin[piece[times == times.min()]] = self.origin.max() + 1

    def _ends(self, graph: csr_array, distance: np.ndarray) -> np.ndarray:
        """Farthest nodes of the ends of the cracked set, without roughness; ascending distance from the origins."""
        strip = np.floor(distance / self.l).astype(int)
        rows = np.repeat(np.arange(graph.shape[0]), np.diff(graph.indptr))
        cols = graph.indices
        inside = strip[rows] == strip[cols]
        same = csr_array((np.ones(int(inside.sum())), (rows[inside], cols[inside])), shape=graph.shape)
        count, piece = connected_components(same, directed=False)
        level = np.zeros(count, int)
        level[piece] = strip
        up = strip[cols] > strip[rows]
        links = {(int(a), int(b)) for a, b in zip(piece[rows[up]], piece[cols[up]])}
        above: list[list[int]] = [[] for _ in range(count)]
        below: list[list[int]] = [[] for _ in range(count)]
        for a, b in links:
            above[a].append(b)
            below[b].append(a)
        reach = np.zeros(count, int)   # highest strip that can be reached going up
        for k in sorted(range(count), key=lambda k: -level[k]):
            reach[k] = max([level[k]] + [reach[b] for b in above[k]])
        ends = [k for k in range(count) if not above[k]]
        kept, taken = [], set()   # taken: pieces on the way to an end that is kept
        farthest = np.zeros(count)
        np.maximum.at(farthest, piece, distance)
        for k in sorted(ends, key=lambda k: -farthest[k]):
            way = [k]
            while below[way[-1]]:
                fork = min(below[way[-1]])
                if any(reach[b] > reach[k] or (reach[b] == reach[k] and b in taken)
                       for b in above[fork] if b != way[-1]):
                    if level[k] - level[fork] < 2.5:  # roughness of the flank of a longer arm
                        way = []
                    break
                way.append(fork)
            if way:
                kept.append(k)
                taken.update(way)
        return np.array([np.flatnonzero(piece == k)[np.argmax(distance[piece == k])] for k in sorted(kept)])

    def _apart(self, gamma: np.ndarray) -> bool:
        whole = np.flatnonzero(gamma >= CRACKED)
        _, label = connected_components(self._graph[whole][:, whole], directed=False)
        labels = np.full(self.space.n_nodes, -1)
        labels[whole] = label
        held = [set(labels[g].tolist()) - {-1} for g in self._grips]
        return any(not (a & b) for i, a in enumerate(held) for b in held[i + 1:])

    def nothing(self) -> Tips:
        """The tips of a body that has not cracked; for a tracker that has marked nothing yet."""
        tips = self.look(0.0, np.ones(self.space.n_nodes))
        self.track.clear()
        return tips

    # --- checkpoints ---
    def memory(self) -> dict[str, np.ndarray]:
        """Everything the tracker remembers, as arrays."""
        return {"cracked_at": self.cracked_at, "origin": self.origin, "track": np.array(self.track).reshape(-1, 2),
                "arrival": np.array(np.nan if self.arrival is None else self.arrival),
                **{name: np.array(getattr(self, name)) for name in self._REMEMBERED}}

    def restore(self, memory: Mapping[str, np.ndarray]) -> None:
        """Take up what :meth:`memory` gave."""
        self.cracked_at, self.origin = memory["cracked_at"].copy(), memory["origin"].copy()
        self.track = [(float(t), float(x)) for t, x in memory["track"]]
        arrival = memory["arrival"].item()
        self.arrival = None if np.isnan(arrival) else arrival
        for name in self._REMEMBERED:
            setattr(self, name, memory[name].item())


def _ways(space: Space) -> csr_array:
    """Distances [mm] of nodes that share an element, (n, n)."""
    graph = space.graph
    lengths: np.ndarray = np.empty(graph.nnz)
    for first in range(0, space.n_nodes, NODES):
        starts = graph.indptr[first:first + NODES + 1]
        some = slice(starts[0], starts[-1])
        rows = np.repeat(np.arange(first, first + starts.size - 1), np.diff(starts))
        lengths[some] = np.linalg.norm(space.X[rows] - space.X[graph.indices[some]], axis=1)
    return csr_array((np.maximum(lengths, 1e-12, out=lengths), graph.indices, graph.indptr), shape=graph.shape)


def _without(graph: csr_array, space: Space, gone: np.ndarray) -> csr_array:
    """A graph of the nodes without the edges that only the elements `gone` have."""
    conn = np.delete(space.conn, gone, axis=0)
    rows, columns = np.repeat(conn, conn.shape[1], axis=1).ravel(), np.tile(conn, (1, conn.shape[1])).ravel()
    there = csr_array((np.ones(rows.size), (rows, columns)), shape=graph.shape)
    there.data[:] = 1.0
    return csr_array(graph.multiply(there))
