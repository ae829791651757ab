"""The protocol: generated files are current, records and packets survive the wire, differences are noticed."""

import dataclasses
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.tools import generate
from gellight.base.errors import BoardError
from gellight.ring import protocol
from gellight.ring.wire import PACKET_BYTES, Packet, cobs_decode, cobs_encode, crc16, decode, encode, layout
from tests.helpers.places import CHECKOUT

packets = st.builds(Packet, st.integers(0, 255), st.integers(0, 255), st.binary(max_size=PACKET_BYTES - 4))


def test_the_generated_files_are_current() -> None:
    assert (CHECKOUT / generate.HEADER).read_text() == generate.header()
    assert (CHECKOUT / generate.DOCUMENT).read_text() == generate.document()


def test_generating_again_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "firmware/core").mkdir(parents=True)
    assert len(generate.generate(tmp_path)) == 2
    assert generate.generate(tmp_path) == []


def test_swapping_two_fields_changes_the_schema_and_a_new_word_of_explanation_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = protocol.schema_crc()
    monkeypatch.setitem(protocol.COMMANDS, "STOP", protocol.COMMANDS["STOP"]._replace(meaning="Stop!"))
    assert protocol.schema_crc() == before
    swapped = dataclasses.make_dataclass(
        "Trim", [("period", protocol.Trim.__annotations__["period"]), ("phase_us", protocol.i32)],
        bases=(protocol.Record,), frozen=True,
    )  # fmt: skip
    monkeypatch.setitem(protocol.COMMANDS, "TRIM", protocol.COMMANDS["TRIM"]._replace(request=swapped))
    assert protocol.schema_crc() != before
    assert generate.header() != (CHECKOUT / generate.HEADER).read_text()


def test_codes_are_unique_and_apart_and_every_record_fits_its_packet() -> None:
    codes = [exchange.code for exchange in protocol.COMMANDS.values()]
    events = [code for code, _ in protocol.EVENTS.values()]
    assert len(set(codes)) == len(codes)
    assert all(code < protocol.EVENT for code in codes)
    assert all(protocol.EVENT <= code < protocol.REPLY for code in events)
    for record in protocol.records():
        assert record.codec().size == sum(record.codec().__class__(f"<{s.code}").size for _, s, _ in layout(record))
        assert record.codec().size <= PACKET_BYTES - 4 - 5


def test_a_record_survives_the_wire_and_a_value_that_does_not_fit_is_refused() -> None:
    step = protocol.SetStep(3, 7, 65535, 60_000_000, 1000)
    assert protocol.SetStep.unpack(step.pack()) == step
    assert step.pack() == bytes([3, 7, 0xFF, 0xFF, 0x00, 0x87, 0x93, 0x03, 0xE8, 3, 0, 0])
    with pytest.raises(ValueError, match="does not fit"):
        protocol.SetStep(256, 0, 1, 0, 0).pack()
    with pytest.raises(BoardError, match="gellight firmware flash"):
        protocol.Trim.unpack(b"1234567")


@given(packets)
def test_a_packet_survives_the_wire(packet: Packet) -> None:
    wire = encode(packet)
    assert wire.count(0) == 1
    assert wire.endswith(b"\0")
    assert decode(wire[:-1]) == packet


@given(packets, st.data())
def test_a_flipped_bit_is_noticed(packet: Packet, data: st.DataObject) -> None:
    wire = bytearray(encode(packet)[:-1])
    position = data.draw(st.integers(0, 8 * len(wire) - 1))
    wire[position // 8] ^= 1 << position % 8
    with pytest.raises(ValueError, match=r"packet|framing"):
        decode(bytes(wire))


@given(st.binary(max_size=600))
def test_cobs_round_trip(body: bytes) -> None:
    assert 0 not in cobs_encode(body)
    assert cobs_decode(cobs_encode(body)) == body


def test_the_crc_is_the_catalogued_one() -> None:
    assert crc16(b"123456789") == 0x29B1  # CRC-16/IBM-3740, the check value of its catalogue entry


def test_a_packet_has_bounds() -> None:
    with pytest.raises(ValueError, match="at most"):
        encode(Packet(1, 1, bytes(PACKET_BYTES)))
    with pytest.raises(ValueError, match="bytes"):
        decode(cobs_encode(b"abc"))
