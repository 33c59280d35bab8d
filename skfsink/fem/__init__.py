"""Finite elements: spaces on a mesh, the weak forms and the compiled loops that equal them, and linear algebra."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
