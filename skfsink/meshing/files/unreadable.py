"""What a reader raises for a file that it cannot read."""

from __future__ import annotations

__all__ = ["Unreadable"]


class Unreadable(ValueError):
    """Why a file cannot be read and what to do, in one line written for the user."""
