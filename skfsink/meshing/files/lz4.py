"""Decompression of blocks of LZ4, in which ParaView may save its files.

The format is described at https://github.com/lz4/lz4/blob/dev/doc/lz4_Block_format.md.
"""

from __future__ import annotations

__all__ = ["lz4_block"]


def lz4_block(data: bytes, most: int) -> bytes:
    """What a block stands for, no more than `most` bytes.

    Raises
    ------
    ValueError, IndexError
        It is no such block.
    """
    out, at, end = bytearray(), 0, len(data)
    while at < end:
        token = data[at]
        length, at = _length(data, at + 1, token >> 4)
        if at + length > end or len(out) + length > most:
            raise ValueError("a run of LZ4 is longer than its block")
        out += data[at:at + length]
        at += length
        if at >= end:  # the last sequence has no match
            break
        offset = data[at] | data[at + 1] << 8
        length, at = _length(data, at + 2, token & 15)
        length += 4
        begin = len(out) - offset
        if not 0 < offset <= len(out) or len(out) + length > most:
            raise ValueError("a match of LZ4 is outside of its block")
        match = out[begin:begin + length]
        while len(match) < length:  # it overlaps what it makes
            match += match[:length - len(match)]
        out += match
    return bytes(out)


def _length(data: bytes, at: int, first: int) -> tuple[int, int]:
    """A length that goes on in further bytes while these are 255, and where it ends."""
    length, more = first, first == 15
    while more:
        length += data[at]
        more = data[at] == 255
        at += 1
    return length, at
