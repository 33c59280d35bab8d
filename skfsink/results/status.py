"""How far a run is: `status.json`, which it keeps while it goes on, and leaves where it did not come to its end."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..errors import OutputError

__all__ = ["STATUS", "Status"]

STATUS = "status.json"


@dataclass(frozen=True)
class Status:
    """How far a run is. It is no result: it depends on the clock, and a run that has come to its end has none.

    Attributes
    ----------
    phase: what it does: "loading", "dynamic", "quasistatic", "output".
    phase_began, written: when the phase began, and of this word [s since 1970].
    fraction: of the phase that is done.
    left_s: estimated time left in the phase [s]; None where it cannot be told yet.
    figures: line of the figures that matter.
    lines: last lines of the log.
    warnings: all so far.
    ended: why the run has ended before its end, in one line; empty while it goes on.
    """

    phase: str
    phase_began: float
    written: float
    fraction: float = 0.0
    left_s: float | None = None
    figures: str = ""
    lines: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    ended: str = ""

    def text(self) -> str:
        """Content of the file."""
        return json.dumps(asdict(self), indent=1, ensure_ascii=False) + "\n"

    @classmethod
    def read(cls, folder: Path) -> Status | None:
        """That of the run in a folder; None if it has none.

        Raises
        ------
        OutputError
            The file is none of these, or cannot be read.
        """
        path = folder / STATUS
        try:
            found: Any = json.loads(path.read_text(encoding="utf-8"))
            left = found["left_s"]
            return cls(str(found["phase"]), float(found["phase_began"]), float(found["written"]),
                       float(found["fraction"]), None if left is None else float(left), str(found["figures"]),
                       tuple(map(str, found["lines"])), tuple(map(str, found["warnings"])), str(found["ended"]))
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise OutputError(f"{path} does not say how far a run is: {error}") from None
