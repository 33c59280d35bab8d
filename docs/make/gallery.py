"""Writes docs/examples.md and docs/examples/NAME.md from the scripts in `examples` and their pictures."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
HEAD = """# Examples

Twelve short scripts. Each runs on one core in less than a minute (the first time compilation comes on top), and ends
with a number that is known from elsewhere: a closed form, a symmetry, a theorem. They are in the folder `examples` of a
clone:

```bash
python examples/rubber_sheet.py                  # leaves rubber_sheet.png and the folder results here
```

These pages are made from the scripts by `python docs/make/gallery.py`, the pictures by running them, `python
examples/make_gallery.py`.
"""
#: in the order of the gallery
NAMES = ("notched_plate", "paper_figure", "rubber_sheet", "ring_bursts", "artery_layers", "fibre_strip", "trousers",
         "cyclic_loading", "own_observable", "own_material", "own_sample", "ensemble_on_dask")


def pages() -> dict[str, str]:
    """The pages, by their path in docs."""
    texts = {name: _parts(name) for name in NAMES}
    rows = [f"| [![{title}](images/examples/{name}.png)](examples/{name}.md) | [{title}](examples/{name}.md)<br>"
            f"{_first_sentence(text).replace('|', chr(92) + '|')} |"
            for name, (title, text, _) in texts.items()]
    index = "\n".join([HEAD, "| | |", "|---|---|", *(row.replace("\n", " ") for row in rows), ""])
    return {"examples.md": index, **{f"examples/{name}.md": _page(name, *parts) for name, parts in texts.items()}}


def _first_sentence(text: str) -> str:
    """The first sentence, with its full stop; "Sec. 5.1" does not end one."""
    return re.split(r"(?<!Sec)\.\s", text)[0].rstrip(".") + "."


def _parts(name: str) -> tuple[str, str, str]:
    """Title, text and code of an example."""
    source = (ROOT / "examples" / f"{name}.py").read_text(encoding="utf-8")
    tree = ast.parse(source)
    title, _, text = (ast.get_docstring(tree) or "").partition("\n")
    code = "".join(source.splitlines(keepends=True)[tree.body[0].end_lineno:])
    return title.rstrip("."), text.strip(), code.strip()


def _page(name: str, title: str, text: str, code: str) -> str:
    return (f"# {title}\n\n{text}\n\n![{title}](../images/examples/{name}.png)\n\n`python examples/{name}.py`\n\n"
            f"```py\n{code}\n```\n\n[All examples](../examples.md)\n")


if __name__ == "__main__":
    (DOCS / "examples").mkdir(exist_ok=True)
    for path, page in pages().items():
        (DOCS / path).write_text(page, encoding="utf-8")
