"""Compiled laws: the element loops take the address of a stored energy, and call it through that."""

from __future__ import annotations

from typing import Any

from numba import float64, types
from numba.core import cgutils
from numba.core.typing import signature
from numba.experimental.function_type import _get_wrapper_address
from numba.extending import intrinsic

__all__ = ["GENERAL_LAW", "LAW", "CompiledLaw", "general_law", "isochoric_law"]

_vector, _matrix, _cube = (types.Array(float64, n, "C") for n in (1, 2, 3))
#: Compiled type of a law of I1': law(I1', constants, psi, psi', psi'') fills the last three, each (n,).
LAW = types.FunctionType(types.void(_vector, _vector, _vector, _vector, _vector))
#: Compiled type of a law of several invariants: law(I (m, n), constants, psi (n,), d (m, n), dd (m, m, n)) fills the
#: last three; entries that are always zero need not be written, they are zero beforehand.
GENERAL_LAW = types.FunctionType(types.void(_matrix, _vector, _vector, _matrix, _cube))


class CompiledLaw(types.WrapperAddressProtocol):
    """A compiled law with its address looked up once; numba would do so at every call, at 0.3 ms each.

    Attributes
    ----------
    address: what :func:`isochoric_law` or :func:`general_law` makes the law of in a loop. A number is taken by numba in
        no time, the law itself in 14 us.
    """

    def __init__(self, law: Any, kind: types.FunctionType = LAW) -> None:
        self._signature = kind.signature
        self.address = int(_get_wrapper_address(law, kind.signature))

    def __wrapper_address__(self) -> int:
        return self.address

    def signature(self) -> Any:
        """Its type."""
        return self._signature


def _at_address(kind: types.FunctionType) -> Any:
    """A function of compiled code: the law of a kind that is at an address."""
    @intrinsic
    def law(typingctx: Any, address: Any) -> Any:
        def code(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
            made = cgutils.create_struct_proxy(kind)(context, builder)
            made.c_addr = builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))
            return made._getvalue()

        return signature(kind, types.int64), code

    return law


isochoric_law = _at_address(LAW)        #: law of I1' alone at an address
general_law = _at_address(GENERAL_LAW)  #: law of several invariants at an address
