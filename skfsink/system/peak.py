"""What memory a process has needed."""

from __future__ import annotations

import sys

import psutil

try:
    import resource
except ImportError:  # Windows, and systems without processes
    resource = None  # type: ignore[assignment]

__all__ = ["peak_rss_mb"]


def peak_rss_mb() -> float:
    """Greatest memory this process has used [MB]; what it uses now, where the system does not keep that."""
    if resource is None:
        memory = psutil.Process().memory_info()
        return float(getattr(memory, "peak_wset", memory.rss)) / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3
