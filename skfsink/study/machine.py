"""What a measurement was made on."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import Any

from ..results.summary import versions

__all__ = ["machine"]


def machine() -> dict[str, Any]:
    """Processor, cores, and the versions of what the figures depend on."""
    model = platform.processor()
    info = Path("/proc/cpuinfo")
    if info.exists():
        model = next((line.split(":")[1].strip() for line in info.read_text().splitlines() if "model name" in line),
                     model)
    return {"processor": model, "cores": os.cpu_count(), "versions": versions()}
