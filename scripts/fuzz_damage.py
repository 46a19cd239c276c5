"""Damage for `scripts/check_fuzz`: changes that chance makes of an input, and inputs that only malice makes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from identify.logs import joint_state

NUMBERS = [0, 1, 255, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**62, 2**63 - 1, 2**63, 2**64 - 1]
WORDS = [
    b"nan",
    b"-inf",
    b"1e999",
    b"9" * 400,
    b"\0",
    b"\xff\xfe",
    b'"',
    b",,,,",
    b"\n\n",
    b"[[",
    b"{" * 300,
    b"a" * 5000,
]
WORDS += [
    b"1_000",
    "٣".encode(),
    b"0x10",
    b"true",
    b"=",
    b"#",
    b"<!ENTITY a 'b'>",
    b"&a;",
    b"<",
    b"/>",
    b"../../etc/passwd",
]


def mutated(data: bytes, rng: np.random.Generator, others: list[bytes]) -> bytes:
    """A few changes of one input; others: inputs of the same kind, to splice from."""
    out = bytearray(data)
    for _ in range(int(rng.choice([1, 1, 1, 2, 3, 6]))):
        size = len(out)
        # Heads and tails are where the structure is.
        near = int(rng.integers(0, max(1, min(size, 600))))
        at = int(rng.choice([near, max(0, size - 1 - near), int(rng.integers(0, max(1, size)))]))
        match int(rng.integers(0, 11)):
            case 0 | 1:
                for _ in range(int(rng.integers(1, 9))):
                    if at < size:
                        out[at] ^= 1 << int(rng.integers(8))
                    at = min(max(0, at + int(rng.integers(-40, 40))), max(0, size - 1))
            case 2:
                del out[at:]
            case 3:
                out[at:at] = rng.bytes(int(rng.integers(1, 200)))
            case 4:
                del out[at : at + int(rng.integers(1, 400))]
            case 5:
                width = int(rng.choice([1, 2, 4, 8]))
                number = NUMBERS[int(rng.integers(len(NUMBERS)))]
                out[at : at + width] = (number % 2 ** (8 * width)).to_bytes(width, "little")
            case 6:
                word = WORDS[int(rng.integers(len(WORDS)))]
                out[at : at + int(rng.integers(0, 12))] = word
            case 7:
                other = others[int(rng.integers(len(others)))]
                start = int(rng.integers(0, max(1, len(other))))
                out[at:at] = other[start : start + int(rng.integers(1, 3000))]
            case 9:
                digits = [k for k in range(at, min(size, at + 200)) if 48 <= out[k] < 58]
                if digits:
                    out[digits[int(rng.integers(len(digits)))]] = int(rng.integers(48, 58))
            case 10:
                lines = bytes(out).split(b"\n")
                line = lines.pop(int(rng.integers(len(lines))))
                if rng.random() < 0.5:
                    lines.insert(int(rng.integers(len(lines) + 1)), line)
                out = bytearray(b"\n".join(lines))
            case 8:
                part = bytes(out[at : at + int(rng.integers(1, 300))])
                out[at:at] = part * int(rng.integers(1, 40))
    return bytes(out)


def hostile() -> Iterator[tuple[str, bytes]]:
    """Inputs that no chance would make: bombs and absurd counts, each a whole file of its kind."""
    import struct
    import zlib

    import zstandard
    from mcap.records import Channel, Header, Schema

    from identify.logs.mcap_file import MAGIC, packed

    head = MAGIC + packed(Header("ros2", "hostile"))
    definitions = packed(
        Schema(1, joint_state.DEFINITION.encode(), "ros2msg", joint_state.NAMES[0]),
        Channel(1, "/joint_states", "cdr", {}, 1),
    )

    def chunk(content: bytes, claimed: int | None = None) -> bytes:
        data = zstandard.ZstdCompressor(level=3).compress(content)
        size = len(content) if claimed is None else claimed
        body = struct.pack("<QQQII4sQ", 0, 1, size, zlib.crc32(content), 4, b"zstd", len(data)) + data
        return struct.pack("<BQ", 6, len(body)) + body

    def loose(content: bytes) -> bytes:
        body = struct.pack("<QQQIIQ", 0, 1, len(content), 0, 0, len(content)) + content
        return struct.pack("<BQ", 6, len(body)) + body

    def message(payload: bytes) -> bytes:
        return struct.pack("<BQHIQQ", 5, 22 + len(payload), 1, 0, 5, 5) + payload

    zeros = bytes(255 << 20)
    yield "mcap", head + definitions + chunk(zeros)
    yield "mcap", head + definitions + chunk(zeros) * 40
    yield "mcap", head + definitions + chunk(zeros[: 1 << 20], claimed=2**63)
    yield "mcap", head + definitions + chunk(zeros, claimed=100)
    yield "mcap", head + chunk(definitions * 200_000)
    yield "mcap", head + definitions + chunk(message(b"") * 8_000_000)
    yield "mcap", head + definitions + chunk((message(b"") + message(b"x")) * 3_000_000)
    yield "mcap", head + definitions + loose(message(b"") * 8_000_000)
    yield "mcap", head + definitions + loose((message(b"") + message(b"x")) * 4_000_000)
    yield "mcap", head + loose(definitions * 300_000)
    yield "mcap", head + definitions + loose(bytes(100 << 20)) * 2
    yield "mcap", head + definitions + struct.pack("<BQ", 5, 200 << 20) + bytes(200 << 20)
    counts = b"\0\1\0\0" + bytes(8) + struct.pack("<I", 1) + bytes(4) + struct.pack("<I", 2**32 - 1) + bytes(200)
    yield "mcap", head + definitions + chunk(message(counts) * 2000)
    strings = (
        b"\0\1\0\0"
        + bytes(8)
        + struct.pack("<I", 1)
        + bytes(4)
        + struct.pack("<I", 60_000)
        + (struct.pack("<I", 1) + bytes(4)) * 60_000
    )
    yield "mcap", head + definitions + chunk(message(strings + bytes(60_000 * 8)) * 3)
    layout = joint_state.layout(("a",), False, False)
    one = layout.template.tobytes()
    yield "mcap", head + definitions + chunk(message(one) * 3_000_000)
    yield "mcap", head + definitions + b"".join(message(one[:-1] + bytes([k % 256])) for k in range(100_000))
    yield "mcap", head + struct.pack("<BQ", 9, 2**62) + bytes(100)
    yield "mcap", head + b"".join(struct.pack("<BQ", 200, 0) for _ in range(1_000_000))
    yield "csv", b"t,q1,tau1\n" + b"1," * 3_000_000 + b"2\n"
    yield "csv", b"t,q1,tau1\n" + b"9" * 60_000_000
    yield "csv", b"t,q1,tau1\n" + b'"' * 200_000 + b"\n" + b"0,1,2\n" * 1000
    yield "csv", b"\n" * 20_000_000
    yield "csv", b"t,q1,tau1\n" + b"0,1e308,-1e308\n1,-1e308,1e308\n" * 5000
    yield "csv", "t,q1,tau1\n".encode("utf-16") + bytes(range(256)) * 300
    yield "map", b"joints = " + b"[" * 100_000
    yield "map", b"rate_hz = " + b"9" * 1_000_000
    yield "toml", b"name = 'x'\n" + b"[[joint]]\nname = 'a'\n" * 20_000
    yield "urdf", b"<robot name='a'>" + b"<link name='x'>" * 100_000
    lol = "".join(f'<!ENTITY l{k + 1} "{f"&l{k};" * 10}">' for k in range(9))
    yield "urdf", f'<?xml version="1.0"?><!DOCTYPE r [<!ENTITY l0 "lol">{lol}]><robot name="&l9;"/>'.encode()
