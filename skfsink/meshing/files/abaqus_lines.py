"""Lines of Abaqus keyword files: keywords with their parameters, and the data lines under each, over all files.

Of https://abaqus-docs.mit.edu/2017/English/SIMACAEMODRefMap/simamod-c-inputsyntax.htm: a line that begins with `*` is a
keyword, one with `**` a comment; a keyword line that ends in a comma goes on; case and blanks do not count, but within
quotation marks.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from . import bounds
from .unreadable import Unreadable

__all__ = ["Block", "is_keyword_file", "listed", "read_blocks", "words"]

DEEPEST = 8  # files within files
MARKS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))
#: keywords that are read, which may be cut short, and their parameters, which may as well
PARAMETERS = {"NODE": ("NSET", "INPUT", "SYSTEM"), "ELEMENT": ("TYPE", "ELSET", "INPUT", "FILE", "OFFSET"),
              "NSET": ("NSET", "ELSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED", "INPUT"),
              "ELSET": ("ELSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED", "INPUT"),
              "SURFACE": ("NAME", "TYPE", "COMBINE", "CROP", "INTERNAL", "TRIM", "INPUT"),
              "USERELEMENT": ("TYPE", "NODES", "COORDINATES", "FILE"), "PART": ("NAME",), "ASSEMBLY": ("NAME",),
              "INSTANCE": ("NAME", "PART", "INSTANCE", "LIBRARY"), "INCLUDE": ("INPUT", "PASSWORD"),
              "NGEN": ("NSET", "LINE", "SYSTEM"), "ELGEN": ("ELSET", "ALLNODES"), "HEADING": (), "SYSTEM": ()}
CUT = {"ELEM": "ELEMENT", "HEAD": "HEADING", "SURF": "SURFACE", "INST": "INSTANCE", "ASSE": "ASSEMBLY",
       "INCL": "INCLUDE"}
FILES = ("INCLUDE", "NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "NGEN", "ELGEN")  # whose INPUT= is read
BARE = re.compile(r"[^\"',]+|\"[^\"]*\"?|'[^']*'?|(,)")


@dataclass
class Block:
    """A keyword and the data lines under it, or those of them that another file has.

    Attributes
    ----------
    keyword: in capitals, without blanks.
    parameters: by name in capitals without blanks; the value as written, "" if there is none.
    file: what a message calls the file, "" for the first one.
    line: the line of the keyword.
    first: that of the first data line.
    data: the data lines, comments and empty ones with them.
    source: the file of the data lines, where that is not `file`.
    """

    keyword: str
    parameters: dict[str, str]
    file: str
    line: int
    first: int
    data: list[str] = field(default_factory=list)
    source: str | None = None

    @property
    def where(self) -> str:
        """The line of the keyword, for a message."""
        return _where(self.file, self.line)

    def place(self, i: int) -> str:
        """The data line `i`, for a message."""
        return _where(self.file if self.source is None else self.source, self.first + i)

    def error(self, text: str, i: int | None = None) -> Unreadable:
        """What is wrong with the keyword, or with its data line `i`."""
        return Unreadable(f"{self.where if i is None else self.place(i)}: {text}")

    def need(self, name: str) -> str:
        """The value of a parameter that must be there."""
        if not (value := self.parameters.get(name, "")):
            raise self.error(f"*{self.keyword} needs {name}=")
        return value

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """The data lines that are no comments, each with its number and its entries; the last is no empty one."""
        for i, line in enumerate(self.data):
            if (text := line.strip()) and not text.startswith("**"):
                yield i, words(text)


def words(text: str) -> list[str]:
    """Entries between commas, without blanks around them and quotation marks; an empty last one is left out."""
    if '"' not in text and "'" not in text:
        found = [word.strip() for word in text.split(",")]
    else:
        found, now = [], ""
        for match in BARE.finditer(text):
            if match[1]:
                found, now = [*found, now], ""
            else:
                now += match[0]
        found = [unquoted(word) for word in (*found, now)]
    if len(found) > 1 and not found[-1]:
        del found[-1]
    return found


def unquoted(word: str) -> str:
    """A word without blanks around it and without its quotation marks; `P-1."my set"` is `P-1.my set`."""
    word = word.strip()
    return word.replace('"', "").replace("'", "") if word[:1] in "\"'" or word[-1:] in "\"'" else word


def is_keyword_file(path: Path) -> bool:
    """Whether the first line of a file that is not empty is a keyword or a comment of Abaqus."""
    with path.open("rb") as file:
        begin = file.read(4096)
    return _decoded(begin).lstrip("\ufeff \t\r\n\f").startswith("*")


def read_blocks(path: Path) -> list[Block]:
    """Keywords and data lines of a keyword file and of those that it includes, in order.

    Raises
    ------
    Unreadable
        A file that is included is not there, not in the folder of `path`, includes itself, or all are too large.
    """
    blocks: list[Block] = []
    _read(path, path.parent.resolve(), (path.resolve(),), blocks, bounds.LARGEST)
    return blocks


def _read(path: Path, folder: Path, above: tuple[Path, ...], blocks: list[Block], most: int) -> int:
    """Append the blocks of a file and of those that it includes; their bytes, of which there are at most `most`."""
    size = path.stat().st_size
    if size > most:
        raise Unreadable("it and the files that it includes are too large together; leave out results and the like")
    shown = _shown(path, folder, above)
    lines = _lines(path.read_bytes())
    stars = [i for i, line in enumerate(lines) if line[:1] in "* \t" and line.lstrip()[:1] == "*"
             and line.lstrip()[:2] != "**"]
    _go_on(blocks, lines, 0, stars[0] if stars else len(lines), shown)
    for n, at in enumerate(stars):
        end = stars[n + 1] if n + 1 < len(stars) else len(lines)
        keyword, parameters, first = _header(lines, at)
        name = parameters.get("INPUT") if keyword in FILES else None
        if keyword != "INCLUDE":
            blocks.append(Block(keyword, parameters, shown, at + 1, first + 1,
                                lines[first:end] if name is None else []))
        elif not name:
            raise Unreadable(f"{_where(shown, at + 1)}: *INCLUDE needs INPUT=")
        if name:
            found = _found(name, folder, above, _where(shown, at + 1))
            size += _read(found, folder, (*above, found), blocks, most - size)
            _go_on(blocks, lines, first, end, shown)
    return size


def _go_on(blocks: list[Block], lines: list[str], first: int, end: int, shown: str) -> None:
    """Data lines of another file than their keyword's, or after such ones, belong to the last keyword."""
    data = lines[first:end]
    if not any(line.strip() and not line.lstrip().startswith("**") for line in data):
        return
    if not blocks:
        raise Unreadable(f"{_where(shown, first + 1)}: data lines come before the first keyword")
    last = blocks[-1]
    if last.keyword in ("INSTANCE", "SYSTEM", "HEADING") and not last.data:
        last.data, last.first, last.source = data, first + 1, shown
    else:
        blocks.append(Block(last.keyword, last.parameters, last.file, last.line, first + 1, data, shown))


def _header(lines: list[str], at: int) -> tuple[str, dict[str, str], int]:
    """Keyword and parameters of the line `at` and those that it goes on in, and the number of the line after these."""
    text, after = lines[at].strip(), at + 1
    while text.endswith(",") and after < len(lines):
        following = lines[after].strip()
        if following.startswith("**") or not following:
            after += 1
            continue
        if not following[0].isalpha() or not ("=" in following or following.rstrip(",").upper() in (
                "GENERATE", "INTERNAL", "UNSORTED")):
            break
        text, after = text + following, after + 1
    first, *rest = words(text)
    keyword = _bare(first.lstrip("*"))
    keyword = CUT.get(keyword, keyword)
    known = PARAMETERS.get(keyword, ())
    parameters = {}
    for part in rest:
        name, _, value = part.partition("=")
        name = _bare(name)
        meant = [k for k in known if len(name) > 2 and k.startswith(name)]
        parameters[name if name in known or len(meant) != 1 else meant[0]] = unquoted(value)
    return keyword, parameters, after


def _bare(text: str) -> str:
    return re.sub(r"\s", "", text).upper()


def _found(name: str, folder: Path, above: tuple[Path, ...], where: str) -> Path:
    """The file that another one names, in the folder of that or of the first one."""
    shown = name[:100] if name.isprintable() else ascii(name[:100])[1:-1]
    failure = f"{where}: the file {shown}, which is included there,"
    if len(above) > DEEPEST:
        raise Unreadable(f"{failure} is the {DEEPEST}th within one another; put the mesh into fewer files")
    for base in dict.fromkeys((folder, above[-1].parent)):
        try:
            path = (base / name.replace("\\", "/")).resolve()
            there = not path.is_relative_to(folder) or path.is_file()
        except (OSError, ValueError, RuntimeError):
            continue
        if not there:
            continue
        if not path.is_relative_to(folder):
            raise Unreadable(f"{failure} is not in the folder of the mesh file; copy it there")
        if path in above:
            raise Unreadable(f"{failure} includes itself")
        return path
    raise Unreadable(f"{failure} is not there; put it beside the mesh file")


def _shown(path: Path, folder: Path, above: tuple[Path, ...]) -> str:
    name = path.relative_to(folder).as_posix() if len(above) > 1 else ""
    return name if name.isprintable() else ascii(name)[1:-1]


def _where(file: str, line: int) -> str:
    return f"line {line} of {file}" if file else f"line {line}"


def _decoded(raw: bytes) -> str:
    encoding = next((name for mark, name in MARKS if raw.startswith(mark)), "utf-8")
    try:
        return raw.decode(encoding)
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _lines(raw: bytes) -> list[str]:
    text = _decoded(raw)
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def listed(names: Iterable[str], most: int = 8) -> str:
    """Names for a message, at most as many as that."""
    shown = [name[:60] if name.isprintable() else ascii(name[:60])[1:-1] for name in names]
    return ", ".join(shown[:most]) + (f" and {len(shown) - most} more" if len(shown) > most else "")
