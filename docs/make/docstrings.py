"""What griffe must know of this package: parameters in one line, and annotations for the command line."""

from __future__ import annotations

import re
from typing import Any

from griffe import Attribute, Expr, ExprSubscript, Extension, Function, Object

SECTION = re.compile(r"^(?:Parameters|Attributes)\n-+\n(?:.+\n?)+", re.MULTILINE)
SHORT = re.compile(r"^(\w+(?:, \w+)*): (.+)$", re.MULTILINE)


def _plain(annotation: Any) -> str | Expr | None:
    """The type in an `Annotated[type, ...]`."""
    if isinstance(annotation, ExprSubscript) and str(annotation.left) == "Annotated":
        return annotation.slice.elements[0]  # type: ignore[union-attr, no-any-return]
    return annotation  # type: ignore[no-any-return]


class Docstrings(Extension):
    """`name: meaning` is read as a parameter `name` with its meaning; `Annotated[float, SAMPLE]` is a float."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Any module, class, function or attribute."""
        if obj.docstring:
            obj.docstring.value = SECTION.sub(lambda found: SHORT.sub(r"\1\n    \2", found[0]), obj.docstring.value)
        if isinstance(obj, Function):
            for parameter in obj.parameters:
                parameter.annotation = _plain(parameter.annotation)
        if isinstance(obj, Attribute):
            obj.annotation = _plain(obj.annotation)
