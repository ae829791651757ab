"""An independent client of ROS 2 over zenoh, which knows nothing of GelLight, gets every topic."""

import json
import re
import socket
import struct
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import zenoh
from scipy.spatial.transform import Rotation

from gellight.base.errors import ConfigError, StreamError
from gellight.base.settings import load_settings
from gellight.cli.one_sensor import published
from gellight.daemon.session import SensorSession
from gellight.frames.measures import Force
from gellight.frames.pose import ObjectPose
from gellight.frames.shear import DotsSeen, Shear, Unseen
from gellight_ros.ros2 import QOS, Ros2Publisher
from gellight_ros.ros_topics import RosTopics, covariance_of, wrench_of
from gellight_ros.ros_types import DEFINITIONS, HASHES, POSE, TF
from gellight_scan.tracking.rigid import pose_of
from tests.helpers.cdr import decoded
from tests.helpers.children import run
from tests.helpers.places import CHECKOUT
from tests.helpers.streamed import bump_daemon, free_port, full_frame
from tests.helpers.waiting import eventually
from tests.helpers.weighed import HeavyFrames

READ_BY_THE_SDK = """
import json, os, sys, threading
from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import ROS2Subscriber
topic, kind, port = sys.argv[1:]
store, came = get_typestore(Stores.ROS2_JAZZY), threading.Event()
def show(message):
    if not came.is_set():
        told = [message.height, message.width, message.encoding, message.step, len(message.data)]
        print(json.dumps([*told, message.header.frame_id]), flush=True)
        came.set()
text, _ = store.generate_msgdef(kind, ros_version=2)
reader = ROS2Subscriber(topic, kind, show, msg_definition=text, type_hash=store.hash_rihs01(kind),
                        router_port=int(port), domain_id=7)
ok = came.wait(60)
os._exit(0 if ok else 1)
"""
OF_EVERY_FRAME = ("image_raw", "camera_info", "depth/image", "points", "contact", "contact/wrench", "contacts")


@contextmanager
def routing() -> Iterator[tuple[zenoh.Session, int]]:
    """What `rmw_zenohd` is to ROS 2, and its port."""
    port = free_port()
    config = zenoh.Config()
    for name, value in {"mode": "router", "listen/endpoints": [f"tcp/127.0.0.1:{port}"],
                        "scouting/multicast/enabled": False}.items():  # fmt: skip
        config.insert_json5(name, json.dumps(value))
    with zenoh.open(config) as session:
        yield session, port


@pytest.fixture
def router() -> Iterator[tuple[zenoh.Session, int]]:
    with routing() as made:
        yield made


@pytest.fixture(scope="module")
def finger() -> Iterator[tuple[zenoh.Session, int]]:
    """The router by which a daemon publishes."""
    daemon, _ = bump_daemon(period_s=0.05, measures=HeavyFrames())
    with (
        routing() as (session, port),
        daemon,
        Ros2Publisher(daemon, f"tcp/127.0.0.1:{port}", name="left finger", domain=7),
    ):
        yield session, port


@pytest.fixture(scope="module")
def heard(finger: tuple[zenoh.Session, int]) -> dict[str, Any]:
    """A message of each topic, decoded; of contacts a later one, for the first knows no velocity."""
    got: dict[str, Any] = {}
    counts: Counter[str] = Counter()

    def note(sample: zenoh.Sample) -> None:
        _, *topic, kind, _ = str(sample.key_expr).split("/")
        definition = DEFINITIONS[kind.replace("::msg::dds_::", "/msg/").rstrip("_")]
        got["/".join(topic)] = decoded(sample.payload.to_bytes(), definition)
        counts["/".join(topic)] += 1

    held = finger[0].declare_subscriber("7/**", note)
    wanted = {"diagnostics", *(f"left_finger/{name}" for name in OF_EVERY_FRAME)}
    eventually(lambda: got.keys() >= wanted and counts["left_finger/contacts"] > 5)
    held.undeclare()
    return got


@pytest.mark.nightly
def test_a_client_of_another_make_gets_the_image(finger: tuple[zenoh.Session, int]) -> None:
    asked = ("/left_finger/image_raw", "sensor_msgs/msg/Image", str(finger[1]))
    done = run([sys.executable, "-c", READ_BY_THE_SDK, *asked], check=True)
    told = json.loads(done.stdout.splitlines()[-1])
    assert told == [48, 64, "rgb8", 192, 48 * 192, "left_finger_camera"]


def test_images_points_and_the_contact_are_in_metres(heard: dict[str, Any]) -> None:
    image, depth = heard["left_finger/image_raw"], heard["left_finger/depth/image"]
    for one, encoding, step in ((image, "rgb8", 192), (depth, "32FC1", 256)):
        assert (one.height, one.width, one.step, one.encoding, len(one.data)) == (48, 64, step, encoding, 48 * step)
        assert (one.header.frame_id, one.header.stamp.sec > 1.6e9) == ("left_finger_camera", True)
    assert 0.0003 < depth.data.view("<f4").max() < 0.01
    points, contact = heard["left_finger/points"], heard["left_finger/contact"]
    assert (points.height, points.width, points.point_step, points.row_step) == (48, 64, 12, 768)
    assert (len(points.data), points.header.frame_id) == (48 * 768, "left_finger_gel")
    assert [contact.point.x, contact.point.y] == pytest.approx([0, 0], abs=1e-4)
    assert 0.00049 < contact.point.z < 0.01, "the first bump is 0.5 mm high, between pixels"


def test_camera_info_and_diagnostics(heard: dict[str, Any]) -> None:
    told = heard["left_finger/camera_info"]
    assert (told.height, told.width, told.distortion_model) == (48, 64, "plumb_bob")
    assert told.k == pytest.approx([400, 0, 31.5, 0, 200, 23.5, 0, 0, 1]), "a gel 40 mm away, 0.1 and 0.2 mm a pixel"
    assert told.d.tolist() == [0] * 5
    assert told.p == pytest.approx([400, 0, 31.5, 0, 0, 200, 23.5, 0, 0, 0, 1, 0])
    (status,) = heard["diagnostics"].status
    assert (status.name, status.message, len(status.values)) == ("gellight: left_finger", "ok", 5)


def test_the_contacts_are_points_with_their_figures_in_si_units(heard: dict[str, Any]) -> None:
    told = heard["left_finger/contacts"]
    assert (told.height, told.width) == (1, 1)
    fields = [(one.name, {6: "<u4", 7: "<f4"}[one.datatype], one.offset) for one in told.fields]
    names, formats, offsets = map(list, zip(*fields, strict=True))
    kind = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": told.point_step})
    (first,) = told.data.view(kind)
    assert [first[name] for name in ("x", "y", "number", "velocity_x", "velocity_y")] == pytest.approx(
        [0, 0, 1, 0, 0], abs=2e-4
    )
    assert 0.00049 < first["z"] < 0.01
    assert 0.3 < first["volume"] / first["area"] / first["z"] < 1
    assert 1e-5 < first["area"] < 3e-4
    assert 0 < first["age"] < 60


def test_the_pose_of_the_object_is_that_of_axes_with_y_up() -> None:
    """Against many motions drawn by the covariance, each made a motion of a right-handed frame by itself."""
    random, mirror = np.random.default_rng(1), np.diag([1.0, -1.0, 1.0])
    root = random.normal(size=(6, 6))
    centre, origin = np.array([1.0, 2.0, 0.5]), np.array([-0.5, 0.3, 0.6])
    motion = pose_of(np.array([0.4, -0.2, 0.1, 0.3, -0.5, 0.9]), origin)
    pose = ObjectPose(number=1, since_sequence=0, motion=motion, origin_mm=origin, centre_mm=centre,
                      covariance=root @ root.T * 1e-6, untellable=np.zeros((0, 6)))  # fmt: skip
    daemon, _ = bump_daemon()
    encode = RosTopics(daemon, "finger").of_frames["object/pose"][1]
    content = encode(replace(full_frame(), pose=pose))
    message = decoded(content, DEFINITIONS[POSE])
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    told = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
    np.testing.assert_allclose(told, mirror @ motion[:3, :3] @ mirror, atol=1e-12)
    assert np.linalg.det(told) == pytest.approx(1)
    there = motion[:3, :3] @ origin + motion[:3, 3]
    np.testing.assert_allclose([place.x, place.y, place.z], [there[0] / 1e3, -there[1] / 1e3, there[2] / 1e3])
    drawn = []
    for twist in random.normal(size=(3000, 6)) @ root.T * 1e-3:
        moved = pose_of(twist, centre) @ motion
        at = mirror @ (moved[:3, :3] @ origin + moved[:3, 3]) / 1e3 - [place.x, place.y, place.z]
        drawn.append([*at, *Rotation.from_matrix(mirror @ moved[:3, :3] @ mirror @ told.T).as_rotvec()])
    seen, stated = np.cov(np.array(drawn).T), message.pose.covariance.reshape(6, 6)
    size = np.sqrt(np.outer(np.diag(stated), np.diag(stated)))
    np.testing.assert_allclose(seen / size, stated / size, atol=0.08)
    assert message.header.frame_id == "finger_gel"
    assert encode(full_frame()) is None
    transform = RosTopics(daemon, "finger").of_frames["/tf"][1]
    told_tf = decoded(transform(replace(full_frame(), pose=pose)), DEFINITIONS[TF])
    (one,) = told_tf.transforms
    assert (one.header.frame_id, one.child_frame_id) == ("finger_gel", "finger_object")
    assert one.header.stamp == message.header.stamp
    assert vars(one.transform.rotation) == vars(turn)
    assert [getattr(one.transform.translation, axis) for axis in "xyz"] == [place.x, place.y, place.z]
    lost = replace(pose, motion=np.full((4, 4), np.nan))
    assert transform(replace(full_frame(), pose=lost)) is None
    assert transform(full_frame()) is None


def test_without_a_constant_for_the_force_there_is_no_wrench(router: tuple[zenoh.Session, int]) -> None:
    wrenches: list[zenoh.Sample] = []
    points: list[zenoh.Sample] = []
    daemon, _ = bump_daemon()
    with daemon, Ros2Publisher(daemon, f"tcp/127.0.0.1:{router[1]}", name="finger"):
        held = [
            router[0].declare_subscriber("0/finger/contact/wrench/**", wrenches.append),
            router[0].declare_subscriber("0/finger/contact/geometry_msgs$*/**", points.append),
        ]
        eventually(lambda: len(points) >= 20)
        assert wrenches == []
        del held


@pytest.mark.nightly
def test_hashes_and_definitions_are_those_of_ros() -> None:
    """The hash covers every field, its type and its place; constants and comments do not count."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    jazzy = get_typestore(Stores.ROS2_JAZZY)
    assert {kind: jazzy.hash_rihs01(kind) for kind in HASHES} == HASHES
    for kind, text in DEFINITIONS.items():
        own = get_typestore(Stores.EMPTY)
        own.register(get_types_from_msg(text, kind))
        assert own.hash_rihs01(kind) == jazzy.hash_rihs01(kind), kind


def test_the_graph_shows_the_node_and_its_topics(finger: tuple[zenoh.Session, int]) -> None:
    """Tokens as rmw_zenoh's design writes them; the attachment has number, time and the 16 bytes of the publisher."""
    session = finger[0]
    keys, until_s = [], time.monotonic() + 60
    while len(keys) < 12 and time.monotonic() < until_s:  # the router learns of them one by one
        replies = session.liveliness().get("@ros2_lv/**", timeout=5)
        keys = sorted(str(reply.ok.key_expr) for reply in replies if reply.ok)
    kinds = [key.split("/")[5] for key in keys]
    assert (kinds.count("NN"), kinds.count("MP")) == (1, 11)
    (image,) = [key for key in keys if "%left_finger%image_raw" in key]
    parts = image.split("/")
    assert parts[1] == "7"
    assert parts[6:10] == ["%", "%", "gellight_left_finger", "%left_finger%image_raw"]
    assert parts[10:] == ["sensor_msgs::msg::dds_::Image_", HASHES["sensor_msgs/msg/Image"], QOS]
    came, got = threading.Event(), []
    held = session.declare_subscriber("7/left_finger/contact/**", lambda one: (got.append(one), came.set()))
    assert came.wait(60)
    number, time_ns, length, _ = struct.unpack("<qqB16s", got[0].attachment.to_bytes())
    assert (number > 0, time_ns > 1.6e18, length) == (True, True, 16)
    held.undeclare()


def test_sensors_without_names_have_topics_of_their_own(router: tuple[zenoh.Session, int]) -> None:
    settings = load_settings({"stream.ros2": f"tcp/127.0.0.1:{router[1]}"})
    came: dict[str, threading.Event] = {topic: threading.Event() for topic in ("images", "images_2")}

    def note(sample: zenoh.Sample) -> None:
        came[str(sample.key_expr).split("/")[1]].set()

    (one, _), (other, _) = bump_daemon(), bump_daemon()
    with one, other, published(one, settings, ""), published(other, settings, ""):
        held = router[0].declare_subscriber("0/*/contact/**", note)
        assert all(event.wait(60) for event in came.values())
        held.undeclare()


def test_a_topic_that_nobody_subscribes_to_costs_nothing(router: tuple[zenoh.Session, int]) -> None:
    daemon, made = bump_daemon(period_s=0.005)
    with daemon, Ros2Publisher(daemon, f"tcp/127.0.0.1:{router[1]}", name="finger") as publisher:
        eventually(lambda: len(made.given) >= 100)
        assert publisher._count < len(made.given) / 2, "the diagnostics alone"


def test_where_there_is_no_router_and_none_can_be_made_the_remedy_is_said() -> None:
    daemon: SensorSession = bump_daemon()[0]
    with daemon, pytest.raises(StreamError, match=r"no router of ROS 2 .*ros2 run rmw_zenoh_cpp rmw_zenohd"):
        Ros2Publisher(daemon, "tcp/nowhere.invalid:7447", name="finger").__enter__()
    daemon = bump_daemon()[0]
    with socket.create_server(("127.0.0.1", 0)) as taken, daemon:
        address = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(StreamError, match=r"cannot be made there .*start one by"):
            Ros2Publisher(daemon, address, name="finger").__enter__()


@pytest.mark.nightly
def test_where_this_computer_has_no_router_the_first_publisher_is_it_and_data_arrives_without_ros() -> None:
    address = f"tcp/localhost:{free_port()}"
    (one, _), (other, _) = bump_daemon(period_s=0.05), bump_daemon(period_s=0.05)
    with (
        one,
        other,
        Ros2Publisher(one, address, name="one") as first,
        Ros2Publisher(other, address, name="two") as second,
    ):
        assert (first.is_router, second.is_router) == (True, False)
        done = run([sys.executable, CHECKOUT / "docs/examples/ros2_check.py", address])
    assert done.returncode == 0, done.stderr
    assert "/one/depth/image: sensor_msgs/msg/Image, stamped" in done.stdout
    assert "/two/image_raw: sensor_msgs/msg/Image, stamped" in done.stdout


@pytest.mark.parametrize(
    "address", ["nonsense", "tcp/localhost", "tcp/", "localhost:7447", "tcp/a b:7447", "tcp/a:1\n"]
)
def test_what_is_no_address_of_a_router_is_refused_in_one_line(address: str) -> None:
    with pytest.raises(ConfigError) as told:
        load_settings({"stream.ros2": address})
    assert re.search(r"is not allowed: give an address such as `tcp/localhost:7447`$", str(told.value))
    assert "\n" not in str(told.value)


# ---- the wrench along the gel ----


REST = np.array([[10.0, 10.0], [30.0, 10.0], [50.0, 10.5]])
DOTS = DotsSeen(
    rest_px=REST, places_px=REST + np.array([[0.5, -0.25], [0, 0], [1.125, 0]]),
    reasons=np.array([Unseen.SEEN, Unseen.MISSING, Unseen.SEEN], np.uint8),
)  # fmt: skip
SHEAR = Shear(
    dots=DOTS, field_mm=np.array([[0.05, -0.025], [np.nan, np.nan], [0.1125, 0]]), force_n=(0.3, -0.4),
    force_error_n=(0.02, 0.03), torque_nmm=1.5, torque_error_nmm=0.25, centre_mm=(2.0, -3.0), flags=("few_dots",),
)  # fmt: skip
PRESSED = Force(normal_n=2.0, error_n=0.1, pressure_of=lambda: np.zeros((1, 1), np.float32))


def test_the_wrench_is_about_the_middle_of_the_image_with_y_up() -> None:
    # At (2, 3) mm with y up pulls (0.3, 0.4, 2) N, and 1.5 N mm turn from x towards y down: r x F + M by hand.
    wrench = np.array(wrench_of(PRESSED, SHEAR))
    place, force = np.array([2e-3, 3e-3, 0]), np.array([0.3, 0.4, 2.0])
    np.testing.assert_allclose(wrench[:3], force)
    np.testing.assert_allclose(wrench[3:], np.cross(place, force) + np.array([0, 0, -1.5e-3]))


def test_the_covariance_is_that_of_the_wrench() -> None:
    rng = np.random.default_rng(0)
    x, y, normal = (rng.normal(0, one, 20000) for one in (0.02, 0.03, 0.1))
    turn = rng.normal(0, 0.25, 20000)
    drawn = [
        wrench_of(replace(PRESSED, normal_n=2 + n), replace(SHEAR, force_n=(0.3 + a, -0.4 + b), torque_nmm=1.5 + t))
        for a, b, n, t in zip(x, y, normal, turn, strict=True)
    ]
    found, scale = covariance_of(PRESSED, SHEAR), np.sqrt(np.diag(covariance_of(PRESSED, SHEAR)))
    np.testing.assert_allclose(
        np.cov(np.array(drawn).T) / np.outer(scale, scale), found / np.outer(scale, scale), atol=0.04
    )


def test_an_unknown_force_is_no_number() -> None:
    unknown = Shear(dots=DOTS, field_mm=SHEAR.field_mm, unknown="another gel")
    wrench = np.array(wrench_of(PRESSED, unknown))
    assert np.isnan(wrench[[0, 1, 5]]).all()
    assert wrench[2] == 2.0
