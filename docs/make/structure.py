"""The structure of the package, read from its source: packages by floor with their sizes, and imports between modules.

`python docs/make/structure.py` prints the sizes; `tests/test_structure.py` holds the imports against the floors.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "skfsink"
PAGE = ROOT / "docs" / "structure.md"
#: what stands above all floors, and what is no module
ABOVE = ("__init__", "__main__")
OTHERS = ("py.typed",)
LONG = 300  # lines of a module
MOST = 6    # positional arguments of a function


@dataclass(frozen=True)
class Import:
    """One name of one import statement: the importing file, its line, and the dotted module that is imported.

    `name` is the name taken from the module, "" where the module itself is imported; `typing` is whether the statement
    stands under `if TYPE_CHECKING`.
    """

    file: Path
    line: int
    module: str
    name: str
    typing: bool

    def __str__(self) -> str:
        return f"{dotted(self.file)}, line {self.line}: {self.module}"


def floors(page: Path = PAGE) -> dict[str, int]:
    """Number of the floor of each top-level package or module, as docs/structure.md declares it; 0 is the lowest."""
    found = re.search(r"^```floors\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    if found is None:
        raise ValueError(f"{page} declares no floors")
    lines = found[1].splitlines()
    return {name: len(lines) - 1 - i for i, line in enumerate(lines) for name in line.split()}


def sources(package: Path = PACKAGE) -> list[Path]:
    """All modules and stubs."""
    return sorted([*package.rglob("*.py"), *package.rglob("*.pyi")])


def dotted(file: Path, package: Path = PACKAGE) -> str:
    """Name of the module in a file."""
    parts = [package.name, *file.relative_to(package).with_suffix("").parts]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def top(module: str) -> str:
    """The top-level package or module that a dotted name belongs to; `__init__` for that of the whole package."""
    return module.split(".")[1] if "." in module else "__init__"


def imports(file: Path, package: Path = PACKAGE) -> Iterator[Import]:
    """Every import of a module of the package, wherever it stands in the file, absolute or relative."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    checked = {id(inner) for node in ast.walk(tree) if isinstance(node, ast.If) and "TYPE_CHECKING" in
               ast.unparse(node.test) for part in node.body for inner in ast.walk(part)}
    parents = [package.name, *file.relative_to(package).parent.parts]
    for node in ast.walk(tree):
        typing = id(node) in checked
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.partition(".")[0] == package.name:
                    yield Import(file, node.lineno, alias.name, "", typing)
        elif isinstance(node, ast.ImportFrom):
            base = parents[:len(parents) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            if module.partition(".")[0] != package.name:
                continue
            for alias in node.names:
                inner = package.parent.joinpath(*module.split("."), alias.name)
                if inner.is_dir() or inner.with_suffix(".py").is_file():
                    yield Import(file, node.lineno, f"{module}.{alias.name}", "", typing)
                else:
                    yield Import(file, node.lineno, module, alias.name, typing)


def dynamic_imports(file: Path) -> list[int]:
    """Lines of a file on which a module is imported or looked for by a name that is made at run time."""
    words = ("import_module", "__import__", "find_spec", "exec_module", "run_module", "load_module")
    calls = (node for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(node, ast.Call))
    return [call.lineno for call in calls if getattr(call.func, "attr", getattr(call.func, "id", "")) in words]


def functions(file: Path) -> Iterator[tuple[str, int, int]]:
    """Name, lines and positional arguments (without self and cls) of each function and method of a file.

    Arguments of a compiled loop are positional for numba and do not count.
    """
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            arguments = [a.arg for a in (*node.args.posonlyargs, *node.args.args) if a.arg not in ("self", "cls")]
            compiled = any("njit" in ast.unparse(decorator) for decorator in node.decorator_list)
            yield (f"{dotted(file)}.{node.name}", (node.end_lineno or node.lineno) - node.lineno + 1,
                   0 if compiled else len(arguments))


def lines(file: Path) -> int:
    """Lines of a file."""
    return len(file.read_text(encoding="utf-8").splitlines())


def report() -> str:
    """The packages with floors and sizes, the longest function, the one with most arguments, and long modules."""
    modules = [file for file in sources() if file.suffix == ".py"]
    sizes: dict[str, list[int]] = {}
    for file in modules:
        name = file.relative_to(PACKAGE).parts[0].removesuffix(".py")
        sizes.setdefault(name, []).append(lines(file))
    total, found = sum(map(sum, sizes.values())), floors()
    text = [f"{len(list(PACKAGE.glob('[!_]*'))) + len(list(PACKAGE.glob('__*__.py*')))} entries in {PACKAGE.name}/", "",
            "floor  package       modules   lines"]
    for name, sizes_of in sorted(sizes.items(), key=lambda item: -found.get(item[0], 99)):
        text.append(f"{found.get(name, '-'):>5}  {name:<12} {len(sizes_of):>8} {sum(sizes_of):>7}  "
                    f"{100 * sum(sizes_of) / total:4.1f} %")
    text.append(f"       {'all':<12} {len(modules):>8} {total:>7}")
    measured = [one for file in modules for one in functions(file)]
    name, length, _ = max(measured, key=lambda one: one[1])
    text.append(f"\nlongest function: {name}, {length} lines")
    name, _, most = max(measured, key=lambda one: one[2])
    text.append(f"\nmost positional arguments: {name}, {most}; functions with over {MOST} (compiled loops apart):")
    text += [f"  {name}, {n}" for name, _, n in measured if n > MOST] or ["  none"]
    text.append(f"\nmodules of over {LONG} lines:")
    text += [f"  {dotted(file)}, {lines(file)}" for file in sorted(modules, key=lines, reverse=True) if
             lines(file) > LONG] or ["  none"]
    return "\n".join(text)


if __name__ == "__main__":
    print(report())
