"""Solvers of the coupled problem: statics to the onset and beyond, and integrators in time."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
