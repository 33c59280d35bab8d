"""Compiled element loops: the weak forms of :mod:`skfsink.fem.forms`, equal to them to rounding and used by every run.

force2d, force3d   internal force, stored energy and its density; explicit steps spend their time here
volumetric         the indicator of the highest frequency, from passes of these two
tiles              the memory layout those two work on, a region of the body after the other
tangent            tangent stiffness with material, geometric and J_bar coupling
general, general_tangent   force and tangent for laws of several invariants, and fibres
plane_stress       all of these for thin sheets
general_sheet, general_sheet_tangent   the same for laws of several invariants
viscous            viscous force, and its derivative with the velocity
pieces             elements of a region for the second derivatives
scalar             mass, Laplacian and sink matrices
gradient           the Laplacian without positive off-diagonals
"""

from .general_sheet_tangent import tangent_general_sheet
from .general_tangent import tangent_general
from .gradient import LEAST_JACOBIAN, monotone, monotone_laplacian
from .plane_stress import tangent_plane_stress
from .records import Viscous
from .scalar import laplacian, mass, weighted_mass
from .tangent import ERSATZ_STIFFNESS, SOFT_GAMMA, tangent
from .tiles import Law, Tiles
from .viscous import viscous_tangent

__all__ = ["ERSATZ_STIFFNESS", "LEAST_JACOBIAN", "SOFT_GAMMA", "Law", "Tiles", "Viscous", "laplacian", "mass",
           "monotone", "monotone_laplacian", "tangent", "tangent_general", "tangent_general_sheet",
           "tangent_plane_stress", "viscous_tangent", "weighted_mass"]
