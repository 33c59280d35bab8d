"""skfsink: dynamic versus quasi-static crack propagation in soft materials by the material-sink theory."""

import lazy_loader

from .system.moved import follow_moves
from .system.scratch import place_matplotlib
from .system.version import __version__ as __version__

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ = [*__all__, "__version__"]

follow_moves()
place_matplotlib()
