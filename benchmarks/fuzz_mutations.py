"""Damage for the fuzzer: what disks, cables, editors and spreadsheets do to a file."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from random import Random

Mutation = Callable[[bytearray, Random], None]

WORDS = [
    b"nan", b"-inf", b"1e999", b"1e-320", b"-", b"+", b".", b",", b";", b"\t", b'"', b"'", b"#",
    b"%", b"0x1f", b"1_000", b"12:34:56", b"\r", b"\n", b"\r\n", b"\n\n", b"\0", b"\xef\xbb\xbf",
    b"\xff\xfe", b"\xb0", b"\xc3", b"\xf0\x9f\x98\x80", b"time", b"Time (s)", b"angle", b"deg",
    b"x", b"rad", b"V", b"Hz", b"sample rate: ", b"9" * 30, b"1.7976931348623157e308", b" " * 40,
    b"stop 01", b"sc ", b"start", b"Resume", b"# volts_per_radian: 0\n", b"# bits: 0\n",
    b"# range_volts: nan\n", b'r="1048576"', b'r="XFD7"', b"A1:XFD1048576", b'count="99999999"',
    b"&#x10ffff;", b"<v>1e400</v>", b"srate x0\n", b"Relative Time,",
]  # fmt: skip
NUMBERS = [0, 1, 2, 3, 4, 7, 8, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x10000, 0x7FFFFFFF,
           0x80000000, 0xFFFFFFFF, 1 << 20, 1 << 28]  # fmt: skip
REALS = [0.0, -0.0, 1.0, -1.0, 1e-310, 1e-9, 1e300, -1e300, float("inf"), float("nan"), 1e30]


def flip(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data))
    data[at] ^= 1 << random.randrange(8)


def overwrite(data: bytearray, random: Random) -> None:
    data[random.randrange(len(data))] = random.randrange(256)


def put_number(data: bytearray, random: Random) -> None:
    width = random.choice((1, 2, 4, 4))
    at = random.randrange(len(data)) & -width
    data[at : at + width] = (random.choice(NUMBERS) & ((1 << 8 * width) - 1)).to_bytes(
        width, random.choice(("little", "little", "big"))
    )


def put_real(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data)) & -2
    data[at : at + 8] = struct.pack("<d", random.choice(REALS))


def put_word(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data) + 1)
    over = random.choice((0, 0, 1, 4))
    data[at : at + over] = random.choice(WORDS)


def cut_out(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data))
    del data[at : at + random.choice((1, 1, 2, 3, 16, 200))]


def repeat(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data))
    part = data[at : at + random.choice((1, 2, 16, 200))]
    data[at:at] = part * random.choice((1, 1, 2, 20))


def truncate(data: bytearray, random: Random) -> None:
    del data[random.randrange(len(data)) :]


def zeroes(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data))
    length = random.choice((4, 64, 512))
    data[at : at + length] = bytes([random.choice((0, 0xFF))]) * length


def swap(data: bytearray, random: Random) -> None:
    one, two = random.randrange(len(data)), random.randrange(len(data))
    data[one], data[two] = data[two], data[one]


def digit(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data))
    data[at : at + 1] = random.choice(b'0123456789-+.,;eE \t\n"').to_bytes(1, "little")


def header(data: bytearray, random: Random) -> None:
    """Damage among the first bytes, where sizes and counts stand."""
    at = random.randrange(min(len(data), 160))
    data[at] = random.choice((0, 1, 0x7F, 0x80, 0xFF, random.randrange(256)))


BINARY: Sequence[Mutation] = (
    flip, flip, overwrite, put_number, put_number, put_real, put_word, cut_out, repeat,
    truncate, zeroes, swap, header, header, header,
)  # fmt: skip
TEXT: Sequence[Mutation] = (
    flip, put_word, put_word, cut_out, repeat, truncate, swap, digit, digit, digit, digit, header,
)  # fmt: skip
HOW_MANY = (1, 1, 1, 2, 2, 3, 5, 8)


def mutate(data: bytes, random: Random, others: Sequence[bytes] = ()) -> bytes:
    """Return damaged bytes: some mutations, at times the end of another file."""
    damaged = bytearray(data)
    kinds = BINARY if b"\0" in data[:200] else TEXT
    if others and random.random() < 0.05:
        other = random.choice(others)
        damaged[random.randrange(len(damaged) + 1) :] = other[random.randrange(len(other) + 1) :]
    for _ in range(random.choice(HOW_MANY)):
        if not damaged:
            break
        random.choice(kinds)(damaged, random)
    return bytes(damaged)
