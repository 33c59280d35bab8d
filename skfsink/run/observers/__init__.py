"""Observers of a run: history, frames, crack, guard, checkpoints, progress, and those of a user."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
