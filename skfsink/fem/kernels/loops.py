"""The loops over tiles, by dimension; 0 is plane stress."""

from __future__ import annotations

from .force2d import force_2d
from .force3d import force_3d
from .general import force_general_2d, force_general_3d
from .general_sheet import force_general_sheet
from .plane_stress import force_plane_stress
from .viscous import viscous_2d, viscous_3d
from .volumetric import volumetric_2d, volumetric_3d

__all__ = ["FORCES", "GENERAL_FORCES", "VISCOUS", "VOLUMETRIC"]

FORCES = {2: force_2d, 3: force_3d, 0: force_plane_stress}
#: of laws of several invariants
GENERAL_FORCES = {2: force_general_2d, 3: force_general_3d, 0: force_general_sheet}
VOLUMETRIC = {2: volumetric_2d, 3: volumetric_3d}
VISCOUS = {2: viscous_2d, 3: viscous_3d}
