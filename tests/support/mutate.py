"""Seeded mutations of a file: the same number gives the same input."""

from __future__ import annotations

import random
import struct

NUMBERS = (0, 1, 2, 7, 8, 16, 32, 127, 128, 255, 256, 1000, 4096, 32767, 32768, 65535, 65536, 2**24, 2**31 - 1, 2**31)
NUMBERS += (2**32 - 1, 2**63 - 1, 2**64 - 1)
WORDS = (
    *(b"\xff\xda", b"\xff\xd9", b"\xff\xe1", b"IHDR", b"IDAT", b"II*\0", b"MM\0*", b"\0\0", b"\n\n", b"-Y 8 +X 16\n"),
    *(b"EXPOSURE=1e99\n", b"string\0", b"chromaticities\0", b"box2i\0", b"chlist\0", b"null", b"true", b"[", b"{"),
    *(b"1e999", b"NaN", b"-1", b"9" * 400, b'"', b"\\", b"\xe9\xff", b"element face 9999999\n", b"f 0 0 0\n"),
    *(b"v 1 2\n", b"end_header\n", b"moov", b"mdat", b"trak", b"stsd", b"\x76\x2f\x31\x01"),
)


def mutated(data: bytes, others: list[bytes], rng: random.Random) -> bytes:
    """One to eight changes of a file; others: to take pieces of."""
    out = bytearray(data)
    for _ in range(1 << rng.randrange(4)):
        if not out:
            break
        rng.choice(CHANGES)(out, others, rng)
    return bytes(out[: 1 << 18])


def _bit(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)


def _byte(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    out[rng.randrange(len(out))] = rng.choice((0, 1, 9, 10, 32, 48, 57, 127, 128, 255, rng.randrange(256)))


def _number(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    code = rng.choice("<H >H <I >I <Q >Q".split())
    value = rng.choice(NUMBERS) & ((1 << 8 * struct.calcsize(code)) - 1)
    at = rng.randrange(len(out))
    piece = struct.pack(code, value)
    out[at : at + len(piece)] = piece


def _cut(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    del out[rng.randrange(len(out)) :]


def _remove(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    at = rng.randrange(len(out))
    del out[at : at + rng.choice((1, 2, 4, 8, 64))]


def _repeat(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    at = rng.randrange(len(out))
    piece = bytes(out[at : at + rng.choice((1, 4, 16, 200))])
    out[at:at] = piece * rng.choice((1, 2, 50))


def _splice(out: bytearray, others: list[bytes], rng: random.Random) -> None:
    other = rng.choice(others)
    start, at = rng.randrange(len(other)), rng.randrange(len(out))
    piece = other[start : start + rng.choice((4, 32, 500))]
    out[at : at + len(piece)] = piece


def _word(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    word, at = rng.choice(WORDS), rng.randrange(len(out))
    out[at : at + len(word) * rng.randrange(2)] = word


CHANGES = (_bit, _byte, _number, _number, _cut, _remove, _repeat, _splice, _word)
