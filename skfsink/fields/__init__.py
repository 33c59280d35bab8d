"""The fields that evolve and their balances: momentum, relative density, energy, and the crack that they show."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
