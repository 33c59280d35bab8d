"""Records that check what people write into them, by cattrs; what is wrong is said in one line."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple, NotRequired, TypedDict

from cattrs import ClassValidationError, Converter, ForbiddenExtraKeysError

from ..errors import ParameterError, require
from ..units import kind_and_unit, number_in

__all__ = ["Mistake", "Record"]


class Mistake(NamedTuple):
    """The first mistake in a record.

    Attributes
    ----------
    field: its name; "" if it is no record at all.   value: what was found there.
    unknown: whether there is no such field.   text: a line that begins with the name of the field.
    """

    field: str
    value: Any
    unknown: bool
    text: str


class Record:
    """Named fields of certain types; nothing is converted that its type does not say: 1 is not true.

    Parameters
    ----------
    types: of the fields, by name, as annotations: `Annotated[float, Unit("mm")]`, `bool`, `str`; or `Annotated` with a
        mark that has a method `read`, whose ParameterError follows the name of the field.
    message: makes the line of an error from a :class:`Mistake` and what was read.
    needed: names of the fields that may not be left out.
    finite: whether a number has to be finite, and becomes a float; otherwise it stays as it is.
    """

    def __init__(self, types: Mapping[str, Any], message: Callable[[Mistake, Any], str], *,
                 needed: Collection[str] = (), finite: bool = False) -> None:
        fields = {name: kind if name in needed else NotRequired[kind] for name, kind in types.items()}
        self._type = TypedDict("Record", fields)  # type: ignore[operator, misc]
        self._message, self._converter = message, Converter(forbid_extra_keys=True)
        for kind, hook in ((str, _text), (bool, _flag), (int, _number("", finite)), (float, _number("", finite))):
            self._converter.register_structure_hook(kind, hook)
        self._converter.register_structure_hook_factory(
            lambda kind: kind_and_unit(kind)[1] != "", lambda kind: _number(kind_and_unit(kind)[1], finite))
        self._converter.register_structure_hook_factory(lambda kind: bool(_readers(kind)), _marked)

    def read(self, values: Any) -> dict[str, Any]:
        """The values, with a number for each quantity.

        Raises
        ------
        ParameterError
            One of them is not of its type, has no field, or is missing.
        """
        if not isinstance(values, Mapping):
            raise ParameterError(self._message(Mistake("", values, False, ""), values))
        try:
            return dict(self._converter.structure(values, self._type))  # type: ignore[call-overload]
        except ClassValidationError as error:
            named, others = error.group_exceptions()
        for wrong, note in named:
            raise ParameterError(self._message(
                Mistake(note.name, values.get(note.name), False, f"{note.name}{wrong}"), values)) from None
        (extra,) = (wrong for wrong in others if isinstance(wrong, ForbiddenExtraKeysError))
        field = next(name for name in values if name in extra.extra_fields)
        raise ParameterError(self._message(Mistake(field, values[field], True, ""), values))


def _text(value: Any, _: Any) -> str:
    if not isinstance(value, str) or not value.isprintable():
        raise ParameterError(f" must be text; got {value!r:.80}")
    return value


def _flag(value: Any, _: Any) -> bool:
    if not isinstance(value, bool):
        raise ParameterError(f" must be true or false; got {value!r:.80}")
    return value


def _number(unit: str, finite: bool) -> Callable[[Any, Any], Any]:
    def read(value: Any, _: Any) -> Any:
        number = number_in("", value, unit)
        return require("", number, unit) if finite else number

    return read


def _readers(kind: Any) -> list[Callable[[Any], Any]]:
    """The methods `read` of the marks in an annotation."""
    return [mark.read for mark in getattr(kind, "__metadata__", ()) if hasattr(mark, "read")]


def _marked(kind: Any) -> Callable[[Any, Any], Any]:
    read = _readers(kind)[0]
    return lambda value, _: read(value)
