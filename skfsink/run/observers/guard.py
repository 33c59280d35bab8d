"""Guards of a run: where a method leaves its range the run says so, or stops, with the cure.

A *warning* says that results depend on something they should not depend on; the run goes on, and `summary.json` lists
it. An *error* stops a run whose state can no longer be trusted. Thresholds stand here, as class attributes; what they
are based on is in `docs/stability.md`.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...errors import InstabilityError, SkfsinkError, place_text
from ...fem import indicators
from ...fields.state import State
from ...material.regions import by_element
from .observer import Observer
from .overlap import overlap
from .places import symmetry_planes
from .range import COARSE, check_onset, check_volume
from .tip import check_tip
from .view import View

__all__ = ["Guard"]

log = logging.getLogger(__name__)


class Guard(Observer):
    """Watches one run of a scene, against the tolerance `balance_tolerance` of its ledger.

    Memory: evenness, energy and notch at the onset, failed elements at the last step, how deep faces overlapped: what
    `check_onset`, `even`, `check_step`, `check_record`, `check_stress`, `check_overlap` and `check_end` say depends on
    them.

    Parameters
    ----------
    every: time between two looks at the whole state [s]; a few comparisons are made in each step.

    Attributes
    ----------
    scale: elastic energy at the onset, to which the others are compared.
    evenness: share of the body that was loaded about as much as its weakest point at the onset.
    notch: what :func:`.check_tip` says of the notch at which the body begins to fail; empty before, and without one.
    dissolved: whether a body that was loaded evenly has failed everywhere at once.
    overlaps: depth [mm] of an overlap of faces when it was first seen, and the greatest; empty before.
    """

    kept = ("scale", "evenness", "notch", "dissolved", "overlaps")
    FLAT = 0.2             # J below which a live point is close to being turned inside out
    LIVE = 0.5             # gamma of a point that must not be inside out
    NEGATIVE = -1e-6       # gamma below which a nodal density is no rounding
    SUDDEN = 0.05, 20      # share of the elements, and their number, that may fail in one step
    DEAD = 0.2             # mean density below which a body is gone
    EVEN = 0.8, 0.9        # of the greatest W/Phi, and the share of the body from which on it is loaded evenly
    DEEPER = 1.5           # times the depth at which an overlap was first seen, that is told at the end
    CARRIED = 0.01         # energy in deleted elements, of the onset energy, that is warned of

    def __init__(self, every: float) -> None:
        self.every = every
        self.scale = self.evenness = 0.0
        self.notch: dict[str, Any] = {}
        self.dissolved = False
        self.overlaps: list[float] = []
        self._deleted = -1   # elements at the last step
        self._inside_out = False

    def open(self, view: View, memory: Mapping[str, Any] | None = None) -> None:
        """Take up what was seen so far."""
        super().open(view, memory)
        self.scene, self.space, self.momentum, self._view = view.scene, view.body.space, view.body.momentum, view

    # --- when it looks ---
    def loading(self, view: View) -> None:
        """Look for faces that overlap in each load increment, and at a stress that was asked for."""
        self.check_overlap(view.state)
        self._check_stress(view)

    def onset(self, view: View) -> None:
        """Look at the state at the onset."""
        self.check_onset(view.state, fails=not view.on_time)

    def unfailed(self, view: View) -> None:
        """Look at the last state of a body that did not fail."""
        check_volume(self.scene, view.state)
        self._check_stress(view)
        self.check_end()

    def due(self, view: View) -> bool:
        """In each step."""
        return True

    def look(self, view: View) -> None:
        """Look at what each step leaves behind, at a record at the whole state, at a frame for faces that overlap."""
        step = view.occasion == "step"
        if step:
            self.check_step(view.state)
        if not step or view.moment or super().due(view):
            self.check_record(view.state)
        if view.stress_is_known or view.framed:  # at a frame
            self.check_overlap(view.state)
            self._check_stress(view)

    def finish(self, view: View) -> None:
        """Sum up."""
        self.check_end()

    def _check_stress(self, view: View) -> None:
        if view.stress_is_known or view.framed:
            self.check_stress(view.state, view.crushed)

    @property
    def _step_cure(self) -> str:
        c = self.scene.controls
        if c.analysis == "quasistatic":
            return f"raise front (now {c.statics.front:g}), or compute with analysis = 'dynamic'"
        if c.integrator == "explicit":
            if (share := self._share_of_limit()) <= 1.0:
                return (f"a shorter step is no cure, since this one is {share:.2f} of its stability limit: refine the "
                        f"mesh there, or take integrator = 'hht'")
            return f"lower courant (now {c.explicit.courant:g})"
        return f"lower hht_dt (now {c.hht.dt:g} s)"

    def _share_of_limit(self) -> float:
        """The explicit step over its stability limit; infinite where that cannot be told any more."""
        try:
            return self._view.step_share
        except SkfsinkError:
            return np.inf

    def check_onset(self, state: State, *, fails: bool = True) -> None:
        """Look at the state at the onset: where it will crack, and whether it is an equilibrium worth starting from.

        Where nothing `fails` yet, as the event begins, no place is the weakest.

        Raises
        ------
        InstabilityError
            The ledger of the loading does not close, or a live point is inside out.
        """
        begun = self._view.body.since_begun(state)
        loaded = self._loaded(begun)
        self.scale = state.ledger.elastic
        if fails:
            self.evenness = self._even_share(loaded)
            check_onset(self.scene, begun)
            planes = [plane.nodes for _, plane in symmetry_planes(self.scene)]
            self.notch = check_tip(self.space, int(np.argmax(loaded)), loaded, planes, self.scene.cracks)
        error, allowed = state.ledger.error(state.ledger.elastic), self.scene.controls.balance_tolerance
        if not error <= allowed:
            raise InstabilityError(f"the ledger of the loading is open by {error:.2%} of the stored energy, allowed "
                                   f"{allowed:.2%}: the body snaps or buckles on its way; hold it sideways, or raise "
                                   f"balance_tolerance")
        self._check_shape(state)

    def _loaded(self, state: State) -> np.ndarray:
        """Greatest W/Phi of each element, (ne,)."""
        phi = by_element(self.space.n_elements, self.scene.sink_law.phi, self.scene.regions,
                         lambda region: region.sink_law.phi)
        ratio: np.ndarray = state.W_max.max(axis=1) / phi
        return ratio

    def _even_share(self, loaded: np.ndarray) -> float:
        """Share of the volume whose W/Phi, `loaded` (ne,), is at least `EVEN` times the greatest one."""
        V = self.space.V
        return float(V[loaded >= self.EVEN[0] * loaded.max()].sum() / V.sum())

    @property
    def even(self) -> bool:
        """Whether the body was loaded evenly at the onset, as a material point is."""
        return self.evenness > self.EVEN[1]

    def _has_dissolved(self) -> bool:
        """Whether this body may fail everywhere at once, since it is loaded evenly; it has, then."""
        self.dissolved = self.dissolved or self.even
        return self.dissolved

    # --- during the event ---
    def _scale(self, state: State) -> float:
        """What errors of energy are relative to: that of the onset, or of a body that began without any, which loads
        set in motion, the greatest of the energies or, while there is none yet, what a crack takes as it runs by l."""
        body, loading = self._view.body, self._view.body.loading
        if self.scale > body.least_energy or (loading.dead is None and loading.followers is None):
            return state.ledger.scale(self.scale)
        return max(state.ledger.scale(0.0), body.crack_energy)

    def check_step(self, state: State) -> None:
        """Look at what every step leaves behind; a few comparisons.

        Raises
        ------
        InstabilityError
            Energy has been fed in, or is no number; too much failed at once; a live point is inside out.
        """
        ledger = state.ledger
        energy_fed_in = -ledger.numerical / self._scale(state)
        allowed = self.scene.controls.balance_tolerance
        if not (energy_fed_in <= allowed and np.isfinite(ledger.elastic + ledger.kinetic)):
            raise InstabilityError(f"energy fed in by the integrator {energy_fed_in:.2%} of the onset energy at "
                                   f"{self._when(state)}, allowed {allowed:.2%}: {self._step_cure}; only then raise "
                                   f"balance_tolerance")
        before, self._deleted = self._deleted, len(state.deletions)
        failed, share = self._deleted - before, self.SUDDEN[0] * self.space.n_elements
        if before >= 0 and failed > max(share, self.SUDDEN[1]) and not self._has_dissolved():
            raise InstabilityError(f"{failed} of {self.space.n_elements} elements failed in one step at "
                                   f"{self._when(state)}, allowed {max(int(share), self.SUDDEN[1])}: elements fail all "
                                   f"over the mesh, not along a crack; {self._step_cure}")
        if self.momentum.least_J <= 0.0 and not self._inside_out:
            self._check_shape(state)

    def check_record(self, state: State) -> None:
        """Look at the whole state, at each row of the history.

        Raises
        ------
        InstabilityError
            The ledger is open, a field is not finite, the body is gone, or a live point is inside out.
        """
        ledger, space, l = state.ledger, self.space, self.scene.sink_law.length_scale
        allowed, scale = self.scene.controls.balance_tolerance, self._scale(state)
        lost = (ledger.deletion - ledger.debris) / scale
        worst, name = max((ledger.error(scale), "energy balance error"),
                          (lost, "energy lost in deleted elements"), key=_nan_first)
        if not worst <= allowed:
            cure = self._deletion_cure if "deleted" in name else self._step_cure
            raise InstabilityError(f"{name} {worst:.2%} of the onset energy at {self._when(state)}, allowed "
                                   f"{allowed:.2%}: {cure}; only then raise balance_tolerance")
        if not (np.isfinite(state.u).all() and np.isfinite(state.v).all() and np.isfinite(state.gamma).all()):
            raise InstabilityError(f"a field is not finite at {self._when(state)}: {self._step_cure}")
        if lost > self.CARRIED:
            log.warning("elements were deleted with %.2g of the onset energy still in them (above %g): %s",
                        lost, self.CARRIED, self._deletion_cure)
        if ledger.numerical > allowed * scale:
            log.warning("the time integration itself has dissipated %.2g of the onset energy (above %g): %s%s",
                        ledger.numerical / scale, allowed, self._step_cure,
                        ", or an hht_alpha nearer to 0" if self.scene.controls.integrator == "hht" else "")
        least = float(state.gamma.min())
        if least < self.NEGATIVE:
            log.warning("the relative density falls to %.2g: the %s sink has no maximum principle; such points are "
                        "taken as dead. sink = 'lumped' keeps it in (0, 1]", least, self.scene.controls.sink)
        if indicators.mean_density(space, state.gamma) < self.DEAD and not self._has_dissolved():
            raise InstabilityError(f"less than {self.DEAD:.0%} of the body is left at {self._when(state)}: "
                                   f"elements fail all over the mesh, not along a crack; {self._step_cure}")
        h = space.h[state.deleted]
        coarse = h > l / COARSE
        if coarse.sum() > max(2, 0.2 * h.size):
            e = int(np.flatnonzero(state.deleted)[np.argmax(h)])
            log.warning("the crack runs through elements of h = %.3g mm, l/h = %.2f (less than %g), near %s mm: its "
                        "width and U are those of the mesh there; refine it to h <= l/3", float(h.max()),
                        l / float(h.max()), COARSE, place_text(space.X[space.conn[e]].mean(axis=0)))
        if self.momentum.least_J < self.FLAT:
            self._check_shape(state)

    def _check_shape(self, state: State) -> None:
        """Live points that are nearly or wholly inside out."""
        least = self.momentum.least_J
        if least >= self.FLAT:
            return
        count, gamma = indicators.inverted(self.space, state.u, self.momentum.gamma)
        if gamma > self.LIVE:
            raise InstabilityError(f"{count} Gauss point(s) with a relative density of up to {gamma:.2f} are inside "
                                   f"out (J <= 0) at {self._when(state)}: {self._step_cure}, or refine the mesh there")
        if count:
            self._inside_out = True
            log.warning("%d damaged Gauss point(s) are inside out (J <= 0), with a relative density of up to %.2g: "
                        "their force means nothing; raise force_floor, or refine the mesh there", count, gamma)
        else:
            log.warning("a live Gauss point is compressed to J = %.2g (below %g): elements soon turn inside out there; "
                        "refine the mesh where it is pressed", least, self.FLAT)

    # --- at the frames ---
    def check_overlap(self, state: State) -> None:
        """Faces of a notch or a crack that have passed through each other; costs as much as a few steps."""
        found = overlap(self.space, state.u, state.gamma, state.deleted)
        if found is None:
            return
        first, most = self.overlaps or (found.depth, found.depth)
        self.overlaps = [first, max(most, found.depth)]
        log.warning("faces pass through each other by %.3g mm at %s, near %s mm of the undeformed body (%.2g of the "
                    "element there), and from then on the body overlaps itself: %s", found.depth,
                    self._when(state), place_text(found.place), found.depth / found.size, self._overlap_cure)

    def check_stress(self, state: State, crushed: np.ndarray) -> None:
        """Elements, a mask (ne,), whose stress is unknown, see :func:`.cauchy_stress`."""
        if crushed.any():
            first = self.space.conn[int(np.argmax(crushed))]
            log.warning("the stress of %d element(s) is not known at %s, as of one near %s mm: a point that exerts a "
                        "force is crushed or inside out there; frames have NaN for it, and 1 in the field crushed; "
                        "refine the mesh where it is pressed, or raise force_floor", crushed.sum(), self._when(state),
                        place_text(self.space.X[first].mean(axis=0)))

    def check_end(self) -> None:
        """Say to what depth faces have passed through each other, if that was more than when it was first seen."""
        if self.overlaps and self.overlaps[1] > self.DEEPER * self.overlaps[0]:
            log.warning("faces have passed through each other by up to %.3g mm: %s", self.overlaps[1],
                        self._overlap_cure)

    @property
    def _overlap_cure(self) -> str:
        if self.scene.controls.contact:
            return "contact acts between the lips of cracks alone; give a notch more width, or refine where lips meet"
        return ("there is no contact; take contact = true for the lips of cracks, end the loading before faces of a "
                "notch meet, or give it more width")

    @property
    def _deletion_cure(self) -> str:
        c = self.scene.controls
        return f"lower deletion (now {c.deletion:g}) or raise force_floor (now {c.force_floor:g}) above it"

    def _when(self, state: State) -> str:
        if self.scene.controls.analysis == "quasistatic" and state.phase == "event":
            return f"pass {state.step}"
        return f"t = {state.time:.4g} s"


def _nan_first(entry: tuple[float, str]) -> float:
    return np.inf if np.isnan(entry[0]) else entry[0]
