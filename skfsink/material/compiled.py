"""Compiled laws: the types by which the element loops call a stored energy through a function pointer."""

from __future__ import annotations

from typing import Any

from numba import float64, types
from numba.experimental.function_type import _get_wrapper_address

__all__ = ["GENERAL_LAW", "LAW", "CompiledLaw"]

_vector, _matrix, _cube = (types.Array(float64, n, "C") for n in (1, 2, 3))
#: Compiled type of a law of I1': law(I1', constants, psi, psi', psi'') fills the last three, each (n,).
LAW = types.FunctionType(types.void(_vector, _vector, _vector, _vector, _vector))
#: Compiled type of a law of several invariants: law(I (m, n), constants, psi (n,), d (m, n), dd (m, m, n)) fills the
#: last three; entries that are always zero need not be written, they are zero beforehand.
GENERAL_LAW = types.FunctionType(types.void(_matrix, _vector, _vector, _matrix, _cube))


class CompiledLaw(types.WrapperAddressProtocol):
    """A compiled law with its address looked up once; numba would do so at every call, at 0.3 ms each."""

    def __init__(self, law: Any, kind: types.FunctionType = LAW) -> None:
        self._signature = kind.signature
        self._address = _get_wrapper_address(law, kind.signature)

    def __wrapper_address__(self) -> int:
        return int(self._address)

    def signature(self) -> Any:
        """Its type."""
        return self._signature
