"""Records that check what people write into them, by pydantic; what is wrong is said in one line.

Importing pydantic takes a tenth of a second: this module is imported where a deck is read.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Annotated, Any, NamedTuple, NotRequired

from pydantic import AfterValidator, BeforeValidator, TypeAdapter, ValidationError, ValidationInfo, with_config
from typing_extensions import TypedDict

from ..errors import ParameterError, require
from ..units import number_in

__all__ = ["Mistake", "Record", "Text", "number"]

#: what a value must be, by pydantic's name of the mistake
MUST_BE = {"string_type": "text", "bool_type": "true or false"}


def _printable(text: str, info: ValidationInfo) -> str:
    if not text.isprintable():
        raise ValueError(f"{info.field_name} must be text; got {text!r:.80}")
    return text


Text = Annotated[str, AfterValidator(_printable)]


def number(unit: str, finite: bool = False) -> Any:
    """Type of a number as it is, or of text with a unit, which becomes a number in `unit`; a float if it is finite."""
    def read(value: Any, info: ValidationInfo) -> Any:
        name = info.field_name or ""
        try:
            found = number_in(name, value, unit)
            return require(name, found, unit) if finite else found
        except ParameterError as error:
            raise ValueError(str(error)) from None  # which pydantic gathers

    return Annotated[Any, BeforeValidator(read)]


class Mistake(NamedTuple):
    """The first mistake in a record.

    Attributes
    ----------
    field: its name; "" if it is no record at all.   value: what was found there.
    kind: pydantic's name of the mistake, such as "extra_forbidden".   text: a line that begins with the field.
    """

    field: str
    value: Any
    kind: str
    text: str


class Record:
    """Named fields of certain types; nothing is converted that its type does not say: 1 is not true.

    Parameters
    ----------
    types: of the fields, by name.
    message: makes the line of an error from a :class:`Mistake` and what was read.
    needed: names of the fields that may not be left out.
    """

    def __init__(self, types: Mapping[str, Any], message: Callable[[Mistake, Any], str], needed: Collection[str] = ()
                 ) -> None:
        fields = {name: kind if name in needed else NotRequired[kind] for name, kind in types.items()}
        strict = with_config({"extra": "forbid", "strict": True})
        self._fields = TypeAdapter(strict(TypedDict("Record", fields)))  # type: ignore[operator]
        self._message = message

    def read(self, values: Any) -> dict[str, Any]:
        """The values as the types have them, in the order of the fields.

        Raises
        ------
        ParameterError
            One of them is not of its type, has no field, or is missing.
        """
        try:
            return self._fields.validate_python(values)  # type: ignore[no-any-return]
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
        field, value, kind = str((*first["loc"], "")[0]), first["input"], first["type"]
        text = (str(first["ctx"]["error"]) if kind == "value_error" else
                f"{field} must be {MUST_BE.get(kind, 'something else')}; got {value!r:.80}")
        raise ParameterError(self._message(Mistake(field, value, kind, text), values))
