"""How to cite: the program and the paper whose theory and examples it computes, as CITATION.cff has them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from ..system.shipped import citation_file

__all__ = ["bibtex", "citations"]


def citations() -> tuple[str, ...]:
    """References as text: the program, then the works that CITATION.cff refers to."""
    program, *works = _entries()
    return (f"{_listed(program)}. {program['title']}. Version {program['version']}, {program['year']}.",
            *(f"{_listed(work)} {work['title']}. {work['journal']}, {work['year']}. doi:{work['doi']}"
              for work in works))


def bibtex() -> str:
    """The same references as entries of BibTeX."""
    program, *works = _entries()
    name = program["title"].partition(":")[0]
    entries = [_bibtex("software", name, program, ("author", "title", "version", "year"))]
    for work in works:
        first = "".join(filter(str.isalpha, work["authors"][0]["family-names"]))
        names = ("author", "title", "journal", "year", "doi")
        entries.append(_bibtex("article", f"{first}{work['year']}", work, names))
    return "\n".join(entries)


@cache
def _entries() -> tuple[Mapping[str, Any], ...]:
    """The program and the works it refers to, each with its year."""
    import yaml  # only reports need it

    program = yaml.safe_load(citation_file().read_text(encoding="utf-8"))
    program["year"] = str(program["date-released"])[:4]
    return program, *program.get("references", ())


def _listed(entry: Mapping[str, Any]) -> str:
    """Authors as in a list of references: "Jabareen, M., and Volokh, K. Y."."""
    *others, last = (author.get("name") or f"{author['family-names']}, " + " ".join(
        f"{name[0]}." for name in author["given-names"].split()) for author in entry["authors"])
    return ", ".join([*others, f"and {last}" if others else last])


def _bibtex(kind: str, key: str, entry: Mapping[str, Any], names: tuple[str, ...]) -> str:
    authors = " and ".join(f"{{{author['name']}}}" if "name" in author else
                           f"{author['family-names']}, {author['given-names']}" for author in entry["authors"])
    values = {**entry, "author": authors}
    width = max(map(len, names))
    rows = ",\n".join(f"  {name:<{width}} = {{{values[name]}}}" for name in names)
    return f"@{kind}{{{key},\n{rows}\n}}\n"
