"""What objects remember between calls is in their docstrings: a scan of the package.

Memory outside of the state is then either written down, or in the `memory` of a method, which checkpoints keep; that a
body carries none from one run to the next is tested in test_state.py.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import skfsink

PACKAGE = Path(skfsink.__file__).parent
CHANGES = {"append", "add", "update", "clear", "pop", "setdefault", "extend", "remove", "insert", "fill"}


class Methods:
    """Attributes that each method of a class writes and reads, and the methods it calls."""

    def __init__(self, node: ast.ClassDef) -> None:
        self.of = {m.name: m for m in node.body if isinstance(m, ast.FunctionDef)}
        self.writes: dict[str, set[str]] = {name: set() for name in self.of}
        self.reads: dict[str, set[str]] = {name: set() for name in self.of}
        self.calls: dict[str, set[str]] = {name: set() for name in self.of}
        for name, method in self.of.items():
            for part in ast.walk(method):
                self._look(name, part)

    def _look(self, name: str, part: ast.AST) -> None:
        if isinstance(part, ast.Attribute | ast.Subscript) and isinstance(part.ctx, ast.Store) and (own := _own(part)):
            self.writes[name].add(own)
        elif isinstance(part, ast.AugAssign) and (own := _own(part.target)):
            self.reads[name].add(own)
        elif isinstance(part, ast.Call) and isinstance(part.func, ast.Attribute) and part.func.attr in CHANGES \
                and (own := _own(part.func.value)):
            self.writes[name].add(own)
        elif isinstance(part, ast.Attribute) and isinstance(part.ctx, ast.Load) and (own := _own(part)):
            (self.calls if own in self.of else self.reads)[name].add(own)

    def depending(self) -> set[str]:
        """Public methods that read, themselves or through others, what another method than `__init__` writes."""
        kept = set().union(*[written for name, written in self.writes.items()
                             if name not in ("__init__", "__post_init__")])
        found = set()
        for name in self.of:
            seen: set[str] = set()
            todo = [name]
            while todo:
                if (here := todo.pop()) not in seen and here in self.of:
                    seen.add(here)
                    todo += self.calls[here]
            if not name.startswith("_") and any(self.reads[other] & kept for other in seen):
                found.add(name)
        return found


def _own(node: ast.AST) -> str:
    """The attribute of `self` that an expression is, or is a part of; empty if of none."""
    while isinstance(node, ast.Subscript):
        node = node.value
    is_own = isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self"
    return node.attr if is_own else ""  # type: ignore[attr-defined]


def classes(source: str) -> dict[str, ast.ClassDef]:
    """The classes of a module by name."""
    return {node.name: node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ClassDef)}


def named(of: str, known: dict[str, ast.ClassDef]) -> set[str]:
    """Methods under "Memory:" in the docstring of a class, of its bases, and of classes that it refers to there."""
    if of not in known:
        return set()
    memory = re.search(r"Memory: (.*?)(\n\n|$)", ast.get_docstring(known[of]) or "", re.DOTALL)
    text = memory[1] if memory else ""
    bases = [base.id for base in known[of].bases if isinstance(base, ast.Name)]
    return set(re.findall(r"`(\w+)`", text)).union(*(
        named(other, known) for other in (*bases, *re.findall(r":class:`\.(\w+)`", text)) if other != of))


def unsaid(source: str, known: dict[str, ast.ClassDef] | None = None) -> Iterator[str]:
    """Methods of public classes that depend on earlier calls, and are not named under "Memory:".

    `known` are the classes of other modules.
    """
    here = classes(source)
    for name, node in here.items():
        if not name.startswith("_"):
            for method in sorted(Methods(node).depending() - named(name, {**(known or {}), **here})):
                yield f"{name}.{method}"


def test_methods_that_depend_on_earlier_calls_say_so() -> None:
    """Fails if a public method's result hangs on what was called before, and the class does not say so."""
    files = sorted(PACKAGE.rglob("*.py"))
    assert len(files) > 100
    known = {name: node for path in files for name, node in classes(path.read_text()).items()}
    found = [f"{path.relative_to(PACKAGE)}: {name}" for path in files for name in unsaid(path.read_text(), known)]
    assert not found, "\n".join(found)


def test_the_scan_sees_a_memory() -> None:
    """Fails if the scan overlooks an attribute that is set, changed in place, or read through another method."""
    source = '''
class Solver:
    """Solves."""
    def __init__(self):
        self.last, self.seen, self.law = None, [], 1
    def solve(self, x):
        if self._same(x):
            return self.last
        self.last = x
        return x
    def _same(self, x):
        return x == self.last
    def note(self, x):
        self.seen.append(x)
        return len(self.seen)
    def pure(self, x):
        return x + self.law
'''
    assert list(unsaid(source)) == ["Solver.note", "Solver.solve"]
    memory = 'Solves.\n\n    Memory: the last one, which `solve` gives again.\n    """'
    said = source.replace('Solves."""', memory)
    assert list(unsaid(said)) == ["Solver.note"]
    base = classes('class Base:\n    """A base.\n\n    Memory: `note` counts."""')
    assert list(unsaid(said.replace("class Solver:", "class Solver(Base):"), base)) == []
