"""The virtual sensor on the wire: every URB is answered once, and what the device says of itself is true."""

import itertools
import socket
import struct
import time
from collections.abc import Iterator

import pytest

from gellight.base.errors import InputError
from gellight.ring.usb_numbers import DATA_INTERFACE, IN_ENDPOINT, OUT_ENDPOINT, PRODUCT, VENDOR
from tests.helpers.usb_client import CardCamera, UsbClient, import_device
from tests.virtual_usb.device import VirtualSensor
from tests.virtual_usb.usbip_server import UsbipServer

SERIAL = "00000000000000A1"


def drain(client: UsbClient) -> None:
    for _ in range(1000):
        client.payload()


@pytest.fixture
def sensor() -> Iterator[VirtualSensor]:
    with VirtualSensor(CardCamera(), frame_rate=200, serial_number="a1") as sensor:
        yield sensor


@pytest.fixture
def client(sensor: VirtualSensor) -> Iterator[UsbClient]:
    ours, theirs = socket.socketpair()
    sensor.plug(theirs)
    with ours:
        yield UsbClient(ours)


def parts(configuration: bytes) -> list[bytes]:
    """The descriptors of a configuration, one after the other."""
    found = []
    while configuration:
        found.append(configuration[: configuration[0]])
        configuration = configuration[configuration[0] :]
    return found


def test_it_is_found_where_a_real_ring_is_looked_for(client: UsbClient) -> None:
    device = client.descriptor(1)
    assert (len(device), *struct.unpack_from("<HH", device, 8)) == (18, VENDOR, PRODUCT)
    texts = [client.descriptor(3, index)[2:].decode("utf-16-le") for index in device[14:17]]
    assert texts == ["GelLight", "GelLight virtual sensor", SERIAL]


def test_its_descriptors_have_the_lengths_that_they_say(client: UsbClient) -> None:
    configuration = client.descriptor(2)
    found = parts(configuration)
    assert struct.unpack_from("<H", configuration, 2)[0] == len(configuration) == sum(map(len, found))
    interfaces = [part for part in found if part[1] == 4]
    assert [part[2] for part in interfaces] == [0, 1, 2, 3] == list(range(configuration[4]))
    for interface, following in itertools.pairwise([*[i for i, p in enumerate(found) if p[1] == 4], len(found)]):
        assert sum(part[1] == 5 for part in found[interface:following]) == found[interface][4]


@pytest.mark.parametrize("subtype", [(14, 1), (14, 2)], ids=["control", "streaming"])
def test_class_specific_headers_count_what_follows_them(client: UsbClient, subtype: tuple[int, int]) -> None:
    found = parts(client.descriptor(2))
    start = next(i for i, part in enumerate(found) if part[1] == 4 and (part[5], part[6]) == subtype)
    specific = [*itertools.takewhile(lambda part: part[1] == 0x24, found[start + 1 :])]
    total = struct.unpack_from("<H", specific[0], 5 if subtype == (14, 1) else 4)[0]
    assert total == sum(map(len, specific))


def test_the_serial_endpoints_are_those_of_the_firmware(client: UsbClient) -> None:
    found = parts(client.descriptor(2))
    start = next(i for i, part in enumerate(found) if part[1] == 4 and part[2] == DATA_INTERFACE)
    assert [part[2] for part in found[start + 1 : start + 3]] == [OUT_ENDPOINT, IN_ENDPOINT]


def test_a_request_that_it_does_not_know_is_refused_and_the_next_is_answered(client: UsbClient) -> None:
    assert client.get(0x40, 0x77, 0, 0, 8).status == -32
    assert client.get(0x21, 0x81, 0x7700, 0x0102, 4).status == -32
    assert client.get(0, 8, 0, 0, 1).data == b"\1"


def test_an_urb_that_is_taken_back_is_answered_once(client: UsbClient) -> None:
    waiting = client.submit(1, incoming=True, length=8)
    assert client.reply(client.unlink(waiting)).status == -104
    assert client.reply(client.unlink(waiting)).status == 0, "it had been answered before"
    client.socket.settimeout(0.1)
    with pytest.raises(TimeoutError):
        client.reply(waiting)


def test_every_urb_of_a_restarted_stream_is_answered_once(client: UsbClient) -> None:
    answered, expected = [], []
    for _ in range(20):
        client.start()
        urbs = [client.submit(3, incoming=True, length=512) for _ in range(5)]
        time.sleep(0.01)
        client.stop()
        unlinks = [client.unlink(urb) for urb in urbs]
        verdicts = [client.reply(number).status for number in unlinks]
        taken = [urb for urb, status in zip(urbs, verdicts, strict=True) if status == 0]
        answered += [client.reply(urb).number for urb in taken]
        expected += taken
    assert answered == expected
    assert 0 < len(answered) <= 100
    client.socket.settimeout(0.1)
    with pytest.raises(TimeoutError):
        client.reply()


def test_pulling_the_plug_ends_the_connection_and_it_can_be_plugged_in_again(sensor: VirtualSensor) -> None:
    for _ in range(3):
        ours, theirs = socket.socketpair()
        sensor.plug(theirs)
        client = UsbClient(ours)
        client.start()
        client.payload()
        sensor.unplug()
        with ours, pytest.raises(ConnectionError):
            drain(client)
        assert sensor.unplugged.wait(5)


def test_a_sensor_has_one_plug(sensor: VirtualSensor, client: UsbClient) -> None:
    assert client.descriptor(1)
    ours, theirs = socket.socketpair()
    with ours, theirs, pytest.raises(InputError, match="plugged in already"):
        sensor.plug(theirs)


def test_it_is_imported_over_the_network_by_one_machine_at_a_time(sensor: VirtualSensor) -> None:
    with UsbipServer({"1-1": sensor}) as server:
        with socket.create_connection(("127.0.0.1", server.port)) as connection:
            assert import_device(connection, "1-1") == (0x10001, 3)
            assert UsbClient(connection).descriptor(3, 3)[2:].decode("utf-16-le") == SERIAL
            with (
                socket.create_connection(("127.0.0.1", server.port)) as second,
                pytest.raises(ConnectionRefusedError, match="'1-1'"),
            ):
                import_device(second, "1-1")
        assert sensor.unplugged.wait(5), "the importer hung up"
        with socket.create_connection(("127.0.0.1", server.port)) as connection:
            import_device(connection, "1-1")


def test_the_list_names_what_can_be_imported(sensor: VirtualSensor) -> None:
    with UsbipServer({"1-1": sensor}) as server, socket.create_connection(("127.0.0.1", server.port)) as connection:
        connection.sendall(struct.pack(">HHI", 0x0111, 0x8005, 0))
        answer = b"".join(iter(lambda: connection.recv(4096), b""))
    version, code, status, count = struct.unpack_from(">HHII", answer)
    assert (version, code, status, count) == (0x0111, 0x0005, 0, 1)
    assert len(answer) == 12 + 312 + 4 * 4
    assert answer[12 + 256 :].startswith(b"1-1\0")
    assert struct.unpack_from(">HH", answer, 12 + 256 + 32 + 12) == (VENDOR, PRODUCT)


@pytest.mark.parametrize("rubbish", [b"GET / HT", bytes(8), b"\x01\x11\x80\x03"], ids=["http", "zeros", "cut off"])
def test_rubbish_is_turned_away_and_the_next_importer_served(sensor: VirtualSensor, rubbish: bytes) -> None:
    with UsbipServer({"1-1": sensor}) as server:
        with socket.create_connection(("127.0.0.1", server.port)) as connection:
            connection.sendall(rubbish)
            connection.shutdown(socket.SHUT_WR)
            assert connection.recv(16) == b""
        with socket.create_connection(("127.0.0.1", server.port)) as connection:
            assert import_device(connection, "1-1")
