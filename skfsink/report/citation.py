"""How to cite: the program and the paper, as in CITATION.cff."""

from __future__ import annotations

from ..system.version import __version__

__all__ = ["BIBTEX", "CITATIONS", "DOI"]

DOI = "10.1115/1.4055670"
_YEAR = 2026
_TITLE = "skfsink: dynamic versus quasi-static crack propagation in soft materials by the material-sink theory"
_PAPER = "Dynamic Versus Quasi-Static Analysis of Crack Propagation in Soft Materials"

#: References as text: the program, then the paper whose theory and examples it computes.
CITATIONS = (
    f"The skfsink developers. {_TITLE}. Version {__version__}, {_YEAR}.",
    f"Abu-Qbeitah, S., Jabareen, M., and Volokh, K. Y. {_PAPER}. Journal of Applied Mechanics, 2022. doi:{DOI}",
)
BIBTEX = f"""@software{{skfsink,
  author  = {{{{The skfsink developers}}}},
  title   = {{{_TITLE}}},
  version = {{{__version__}}},
  year    = {{{_YEAR}}}
}}

@article{{AbuQbeitah2022,
  author  = {{Abu-Qbeitah, Suhib and Jabareen, Mahmood and Volokh, Konstantin Y.}},
  title   = {{{_PAPER}}},
  journal = {{Journal of Applied Mechanics}},
  year    = {{2022}},
  doi     = {{{DOI}}}
}}
"""
