"""What the site needs besides its pages: formulas as MathML, files from elsewhere, and links that hold in both."""

from __future__ import annotations

import base64
import html
import json
import re
import unicodedata
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from markdown import Extension, Markdown
from markdown.blockprocessors import ListIndentProcessor, OListProcessor, UListProcessor
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
#: pages that stand at the top of the repository
OUTSIDE = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
LINK = re.compile(r"(\]\()([^)#\s]+)")
HEADING = re.compile(r"\\\((.*?)\\\)")
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)
#: variants of letters that browsers no longer make themselves
LETTER = re.compile(r'<(m[in]) mathvariant="(bold|script|bold-italic)">(&#x\w+;|.)</\1>')
ROLE = re.compile(r":(?:class|func|meth|attr|mod|exc):<code>~?([\w.]+)</code>")


class ListsAsOnGitHub(Extension):
    """Lists that are indented by two blanks."""

    def extendMarkdown(self, md: Markdown) -> None:
        width, md.tab_length = md.tab_length, 2
        blocks = md.parser.blockprocessors
        for name, kind, priority in (("indent", ListIndentProcessor, 90), ("olist", OListProcessor, 40),
                                     ("ulist", UListProcessor, 30)):
            blocks.register(kind(md.parser), name, priority)
        md.tab_length = width


def on_config(config: Any) -> Any:
    """Lists are read as GitHub reads them."""
    config.markdown_extensions.append(ListsAsOnGitHub())
    return config


def on_files(files: Files, config: Any) -> Files:
    """Take in the figures, the pictures of decks, and the pages at the top of the repository."""
    for path in sorted((*ROOT.glob("figures/*.png"), *ROOT.glob("cases/*/*.png"))):
        files.append(File.generated(config, path.relative_to(ROOT).as_posix(), abs_src_path=str(path)))
    for name, page in OUTSIDE.items():
        files.append(File.generated(config, page, content=(ROOT / name).read_text(encoding="utf-8")))
    for path in sorted((ROOT / "docs").glob("*.ipynb")):
        text, pictures = notebook(path)
        files.append(File.generated(config, f"{path.stem}.md", content=text))
        for name, picture in pictures.items():
            files.append(File.generated(config, name, content=picture))
    return files


def notebook(path: Path) -> tuple[str, dict[str, bytes]]:
    """A notebook as a page, with what its cells print, and its pictures by file name."""
    lines: list[str] = []
    pictures: dict[str, bytes] = {}
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        lines += [source, ""] if cell["cell_type"] == "markdown" else ["```python", source, "```", ""]
        for output in cell.get("outputs", []):
            if text := "".join(output.get("text", [])):
                lines += ["```text", text.rstrip(), "```", ""]
            if picture := output.get("data", {}).get("image/png"):
                name = f"{path.stem}_{len(pictures)}.png"
                pictures[name] = base64.b64decode("".join(picture))
                lines += [f"![]({name})", ""]
    return "\n".join([*lines, f"This page is the notebook [{path.name}]({path.name})."]), pictures


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Links as they are in the site; those in code are none."""
    there = page.file.src_uri in OUTSIDE.values()

    def place(link: re.Match[str]) -> str:
        target = link[2]
        target = target.removeprefix("docs/") if there else target.removeprefix("../") if target.startswith(
            ("../figures/", "../cases/", *(f"../{name}" for name in OUTSIDE))) else target
        return link[1] + OUTSIDE.get(target, target)

    return LINK.sub(place, markdown)


def _letter(found: re.Match[str]) -> str:
    """The character of Unicode that a bold or script letter is."""
    words = [word for word in unicodedata.name(html.unescape(found[3])).split() if word not in (
        "LATIN", "GREEK", "LETTER")]
    name = " ".join((found[2].replace("-", " ").upper(), *words))
    try:
        character = unicodedata.lookup(f"MATHEMATICAL {name}")
    except KeyError:
        character = unicodedata.lookup(name)
    return f"<{found[1]}>{character}</{found[1]}>"


def mathml(text: str, block: bool) -> str:
    """A formula as MathML.

    Raises
    ------
    PluginError
        It has a command that is not known.
    """
    made = convert(text, display="block" if block else "inline")
    made = made.replace("<mo>&#x0002F;</mo>", '<mo lspace="0" rspace="0">/</mo>')
    if "\\" in made or "merror" in made:
        raise PluginError(f"this formula cannot be shown: {text}")
    return LETTER.sub(_letter, made)


def on_page_content(content: str, page: Page, **_: Any) -> str:
    """Formulas become MathML, which browsers draw themselves; names in docstrings become links."""

    def formula(found: re.Match[str]) -> str:
        made = mathml(html.unescape(found[3]), found[2] == "[")
        return f'<div class="formula">{made}</div>' if found[2] == "[" else made

    def name(found: re.Match[str]) -> str:
        return f'<autoref identifier="{found[1]}" optional><code>{found[1].rpartition(".")[2]}</code></autoref>'

    headings = list(page.toc)
    for heading in headings:  # grows
        heading.title = HEADING.sub(lambda found: mathml(html.unescape(found[1]), False), heading.title)
        headings += heading.children
    return ROLE.sub(name, FORMULA.sub(formula, content))
