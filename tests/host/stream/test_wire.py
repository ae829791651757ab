"""What is sent arrives bit for bit; what is not a frame is refused with the reason, whatever it holds."""

import io
import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gellight.base.errors import StreamError
from gellight.bundle.bundle import Bundle, extend_bundle
from gellight.frames.frames import TactileFrame
from gellight.frames.measures import STEEP, MapOnRequest
from gellight.frames.pose import ObjectPose
from gellight.frames.shear import MOST_DOTS, DotsSeen, Shear
from gellight.reconstruction.contact import MOST_PATCHES
from gellight.reconstruction.measures import BundleMeasures
from gellight.stream.wire import PLANE, PREFIX, decode, encode
from tests.helpers.dashboard_source import bump
from tests.helpers.drawn_frames import check_same, tactile_frames
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.streamed import SHAPE, full_frame
from tests.helpers.weighed import force_files


def no_bundle(zero: str) -> Bundle:
    raise AssertionError("nobody asked for the difference image")


@given(tactile_frames())
@settings(max_examples=50, suppress_health_check=list(HealthCheck))
def test_whatever_a_frame_has_arrives_as_it_was_sent(sent: TactileFrame) -> None:
    got = decode(encode(sent), no_bundle)
    check_same(sent, got, but=("ages_s", "difference", "measures"))
    assert got.provenance.ages_s.keys() == {*sent.provenance.ages_s, "published", "received"}
    assert got.shear is None or got.shear.dots is got.camera_frame.dots


@pytest.mark.parametrize("left_out", [rb'"contacts":\[.*?\}\],', rb'"dots":null,"shear":null,"slip":null,'])
def test_a_frame_of_a_daemon_that_knew_less_is_read(left_out: bytes) -> None:
    old, times = re.subn(left_out, lambda found: b" " * len(found[0]), encode(full_frame()))
    assert times == 1
    got = decode(old, no_bundle)
    assert (got.contacts == ()) == (b"contacts" not in old)
    assert got.shear is got.slip is None


MOTION = b"[0.0,1.0,2.0,3.0,4.0,5.0,6.0,7.0,8.0,9.0,10.0,11.0]"


@pytest.mark.parametrize(
    ("whole", "spoilt"),
    [
        (b'"reasons":[0,1,0]', b'"reasons":[0,1]'),
        (b'"reasons":[0,1,0]', b'"reasons":[0,9,0]'),
        (b'"field_mm":[[0.05,-0.025],', b'"field_mm":['),
        (MOTION, b"[1.0]"),
    ],
)
def test_damaged_dots_and_a_damaged_pose_are_refused(whole: bytes, spoilt: bytes) -> None:
    motion = np.vstack([np.arange(12.0).reshape(3, 4), [0, 0, 0, 1]])
    pose = ObjectPose(number=3, since_sequence=9, motion=motion, origin_mm=np.arange(3.0), centre_mm=np.ones(3),
                      covariance=np.eye(6), untellable=np.zeros((0, 6)))  # fmt: skip
    places, frame = np.full((3, 2), 9.5), full_frame()
    dots = DotsSeen(rest_px=places, places_px=places, reasons=np.array([0, 1, 0], np.uint8))
    sent = replace(frame, pose=pose, camera_frame=replace(frame.camera_frame, dots=dots))
    vars(sent)["shear"] = Shear(dots=dots, field_mm=np.array([[0.05, -0.025], [np.nan, np.nan], [0.1125, 0]]))
    message = encode(sent)
    assert decode(message, no_bundle).pose.number == 3
    with pytest.raises(StreamError, match=r"damaged|pose"):
        decode(message.replace(whole, spoilt.ljust(len(whole))), no_bundle)
    assert message.count(whole) == 1


def test_the_provenance_arrives_with_the_ages_of_the_journey() -> None:
    sent = full_frame()
    sent = replace(sent, provenance=replace(sent.provenance, unix_s=time.time() - 0.5))
    got = decode(encode(sent), no_bundle).provenance
    assert list(got.ages_s) == ["taken", "reconstructed", "published", "received"]
    assert 0.5 <= got.ages_s["published"] <= got.ages_s["received"] < 10
    assert replace(got, ages_s={}) == replace(sent.provenance, ages_s={})


def test_the_difference_image_is_made_with_the_reference_of_its_zero(tmp_path: Path) -> None:
    bundle = linear_bundle(tmp_path / "bundle", shape=SHAPE)
    sent = full_frame()
    asked: list[str] = []

    def bundle_of(zero: str) -> Bundle:
        asked.append(zero)
        return bundle

    got = decode(encode(sent), bundle_of)
    assert asked == []
    image = sent.camera_frame.image.astype(np.float32)
    assert np.allclose(got.difference, image - bundle.reference)
    assert asked == [sent.provenance.zero]


@pytest.mark.parametrize("asked", [[MapOnRequest.PRESSURE], [MapOnRequest.CONFIDENCE], list(MapOnRequest)])
def test_what_is_asked_for_travels_and_the_rest_is_computed_to_the_same(
    tmp_path: Path, asked: list[MapOnRequest]
) -> None:
    plain = linear_bundle(tmp_path / "plain", shape=SHAPE)
    bundle = extend_bundle(plain, tmp_path / "bundle", force_files())
    sent = replace(full_frame(), measures=BundleMeasures(bundle))
    assert len(encode(sent, asked)) > len(encode(sent)) + SHAPE[0] * SHAPE[1] * 4
    zeros: list[str] = []
    got = decode(encode(sent, asked), lambda zero: (zeros.append(zero), bundle)[1])
    assert sent.force.pressure_mpa.max() > 0
    assert np.array_equal(got.force.pressure_mpa, sent.force.pressure_mpa)
    assert np.array_equal(got.confidence.value, sent.confidence.value)
    assert np.array_equal(got.confidence.quality_flags, sent.confidence.quality_flags)
    assert (zeros == []) == (len(asked) == 2), "the bundle is fetched for what did not come"
    for name, plane in sent.maps_on_request(asked).items():
        assert got.maps_on_request()[name].dtype == plane.dtype


def test_what_an_older_sender_calls_otherwise_is_understood(tmp_path: Path) -> None:
    plain = linear_bundle(tmp_path / "plain", shape=SHAPE)
    sent = replace(full_frame(), measures=BundleMeasures(plain, from_network=False))
    message = encode(sent, [MapOnRequest.CONFIDENCE])
    older = message.replace(b"quality_flags\0", b"doubts".ljust(14, b"\0"))
    older = older.replace(b'"from_network":', b'"learnt":'.ljust(15))
    assert older.count(b"doubts") == older.count(b"learnt") == 1
    got = decode(older, lambda _: plain)
    assert np.array_equal(got.confidence.quality_flags, sent.confidence.quality_flags)
    assert got.measures.from_network is False


@pytest.mark.parametrize("from_network", [True, False])
def test_the_confidence_computed_by_a_reader_knows_where_the_slopes_come_from(
    tmp_path: Path, from_network: bool
) -> None:
    """A slope beyond what a network has learnt says nothing against one that was measured."""
    plain = linear_bundle(tmp_path / "plain", shape=SHAPE)
    rows = np.full((100, 7), 1e-3)  # nearly flat presses: every slope of the bump is steeper
    presses = io.BytesIO()
    np.savez(presses, rows=rows, press=np.zeros(100, int))
    bundle = extend_bundle(plain, tmp_path / "bundle", {"presses.npz": presses.getvalue()})
    sent = replace(full_frame(), measures=BundleMeasures(bundle, from_network=from_network))
    got = decode(encode(sent), lambda _: bundle)
    assert ((sent.confidence.quality_flags & STEEP).any()) == from_network
    assert np.array_equal(got.confidence.quality_flags, sent.confidence.quality_flags)


def test_a_message_is_hardly_longer_than_its_maps_and_what_is_not_there_stays_so() -> None:
    sent = full_frame()
    maps = 3 + 2 * 4 + 4 + 1 + 1 + 1  # bytes of a pixel: image, gradient, depth, contact, lights, moving
    assert 0 < len(encode(sent)) - SHAPE[0] * SHAPE[1] * maps < 4096
    got = decode(encode(sent, list(MapOnRequest)), no_bundle)
    assert (got.force, got.confidence, got.maps_on_request()) == (None, None, {})
    for centroid_mm in ((np.nan, 1.0), (1.0, np.nan)):
        broken = replace(sent, contact=replace(sent.contact, centroid_mm=centroid_mm))
        assert decode(encode(broken), no_bundle).contact.centroid_mm is None


def test_details_longer_than_any_are_refused_unread() -> None:
    message = encode(full_frame())
    magic, version, planes, place, length, *rest = PREFIX.unpack_from(message)
    details = message[place : place + length].ljust(1_048_576)
    header = PREFIX.pack(magic, version, planes, len(message), len(details), *rest)
    assert decode(header + message[PREFIX.size :] + details, no_bundle).contacts
    details += b" "
    header = PREFIX.pack(magic, version, planes, len(message), len(details), *rest)
    with pytest.raises(StreamError, match="1048577 bytes of details"):
        decode(header + message[PREFIX.size :] + details, no_bundle)


def test_a_frame_that_no_daemon_delivered_and_one_of_another_version_are_refused() -> None:
    with pytest.raises(StreamError, match="provenance"):
        encode(bump(0.5, 0, 0, shape=SHAPE))
    message = bytearray(encode(full_frame()))
    message[4:6] = (2).to_bytes(2, "little")
    with pytest.raises(StreamError, match=r"version 2 .* reads 1.*update GelLight"):
        decode(bytes(message), no_bundle)


MESSAGE = encode(full_frame())


@given(st.integers(0, len(MESSAGE)))
@settings(max_examples=60)
def test_a_message_that_is_cut_off_is_refused(length: int) -> None:
    if length > PREFIX.size:
        last = max(PLANE.unpack_from(MESSAGE, PREFIX.size + k * PLANE.size)[3] for k in range(5))
        length = min(length, last)
    with pytest.raises(StreamError):
        decode(MESSAGE[:length], no_bundle)


@given(st.data())
@settings(max_examples=200)
def test_hostile_bytes_neither_crash_nor_take_memory(data: st.DataObject) -> None:
    """Bytes of the header are changed at random: what comes out is a frame that lies in the message, or a refusal."""
    message = bytearray(MESSAGE)
    header = PREFIX.size + 5 * PLANE.size + 900
    for place in data.draw(st.lists(st.integers(6, header), min_size=1, max_size=8)):
        message[place] = data.draw(st.integers(0, 255))
    try:
        frame = decode(bytes(message), no_bundle)
    except StreamError:
        return
    assert frame.depth_mm.base is not None, "a view of the message"
    assert frame.depth_mm.nbytes <= len(message)


def test_as_many_dots_and_contacts_as_a_gel_may_have_travel() -> None:
    frame, places = full_frame(), np.random.default_rng(0).uniform(0, 640, (MOST_DOTS, 2))
    dots = DotsSeen(rest_px=places, places_px=places + 3, reasons=np.zeros(MOST_DOTS, np.uint8))
    many = replace(
        frame, camera_frame=replace(frame.camera_frame, dots=dots), contacts=frame.contacts[:1] * MOST_PATCHES
    )
    vars(many)["shear"] = Shear(dots=dots, field_mm=places / 1000, unknown="")
    come = decode(encode(many), lambda zero: None)
    assert (len(come.camera_frame.dots.reasons), len(come.contacts)) == (MOST_DOTS, len(many.contacts))
