"""Text files as people's programs write them: with a byte order mark, in UTF-16, with the line ends of Windows.

Usual mistakes in a TOML file are reported with their cure.
"""

from __future__ import annotations

import codecs
import re
import tomllib
from pathlib import Path
from typing import Any

__all__ = ["NotText", "decoded", "read_toml"]

MARKS = ((codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32"), (codecs.BOM_UTF16_LE, "utf-16"),
         (codecs.BOM_UTF16_BE, "utf-16"), (codecs.BOM_UTF8, "utf-8-sig"))  # the longest first
QUOTES = re.compile("[“”„‟«»‘’]")
#: what a line of TOML that cannot be read looks like, and the cure
CURES = (
    (re.compile(r"""=\s*[^'#]*"[^"#]*\\"""), r'for \ in a path write /, or put the path in single quotes'),
    (QUOTES, "write straight quotes, \""),
    (re.compile(r"""=\s*[+-]?\d+,\d"""), "decimals stand after a point, as in 1.5"),
    (re.compile(r"""=\s*[+-]?[\d.]+(?:[eE][+-]?\d+)?\s*[A-Za-zµμ°/%]"""), 'text stands in quotes, as in "5 mm"'),
    (re.compile(r"""=\s*[A-Za-z_./]"""), 'text stands in quotes, as in "M3"'),
    (re.compile(r"""^[\w\s.-]+:"""), "write = between name and value"),
)


class NotText(ValueError):
    """A file that holds no text; the message is one line with the cure."""


def decoded(content: bytes) -> str:
    r"""The text of a file's content, with \n at the end of each line.

    Raises
    ------
    NotText
        It is in no encoding of Unicode; the message names the line.
    """
    encoding = next((name for mark, name in MARKS if content.startswith(mark)), "utf-8")
    if encoding == "utf-8" and len(content) > 1 and content[:2].count(0) == 1:
        raise NotText("it is UTF-16 without a byte order mark: save it as UTF-8")
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise NotText(f"line {line} has a character that is no {encoding.upper()} (byte 0x{content[error.start]:02x}): "
                      f"save the file as UTF-8") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_toml(path: Path) -> dict[str, Any]:
    """The content of a TOML file.

    Raises
    ------
    OSError
        It cannot be read.
    ValueError, RecursionError
        It holds no text, or no TOML; the message is one line, with the cure if the mistake is a usual one.
    """
    text = decoded(path.read_bytes())
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message = str(error).splitlines()[0]
        at = re.search(r"at line (\d+)", message)
        lines = text.split("\n")
        if message.startswith(("Cannot overwrite", "Cannot declare")) and (again := _again(at and int(at[1]), lines)):
            raise ValueError(again) from None
        line = lines[min(int(at[1]), len(lines)) - 1] if at else ""
        cure = next((f": {cure}" for pattern, cure in CURES if pattern.search(line)), "")
        raise ValueError(message + cure) from None


def _again(number: int | None, lines: list[str]) -> str:
    """What a line of a TOML file has for the second time; "" if it begins with neither a key nor a table.

    Without a `number` it is the last one that has more than a comment.
    """
    if number is None:
        number = max(i for i, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#"))
    found = re.match(r"""\s*(?:\[+\s*([\w."'-]+)\s*\]|([\w."'-]+)\s*=)""", lines[number - 1])
    if found is None:
        return ""
    if found[1]:
        return (f"line {number} has the table {found[1]} again: leave one, or, where there may be several, write "
                f"[[{found[1]}]] for each")
    return f"line {number} gives {found[2]} a second time: leave one"
