"""Make live.png and ros2.png, the pictures of docs/streaming.md.

    .venv/bin/python docs/pictures/robot.py

Both are drawn from what another program receives of `gellight run`: the first by `gellight.subscribe`, the second by a
subscriber of ROS 2's wire, which knows nothing of GelLight.
"""

import json
import socket
import subprocess
import sys
import threading
from pathlib import Path

import cv2
import numpy as np
import zenoh
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore

import gellight
from gellight.lab.report.pictures import Picture, depth_bar, depth_picture, write_png

FOLDER = Path(__file__).parent
SENSOR = "sim://?object=BALL&depth=1&x=3&y=-2"
PATIENCE_S = 60.0
PAPER = (20, 22, 28)
TURN, TILT = np.radians([35.0, 55.0])
"""of the view on the points: about z, then back"""
STRETCH = 4.0
"""depth is drawn so much larger than width and height"""
POINT_SCALE = 22_000.0
"""px a metre"""
STORE = get_typestore(Stores.ROS2_JAZZY)


def main() -> None:
    """Run the sensor, receive, and write the pictures beside this file."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        router = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    config = zenoh.Config()
    for name, value in {"mode": "router", "listen/endpoints": [router], "scouting/multicast/enabled": False}.items():
        config.insert_json5(name, json.dumps(value))
    command = [
        Path(sys.executable).with_name("gellight"),
        "run",
        "--sensor",
        SENSOR,
        "--no-dashboard",
        "--set",
        f"stream.ros2={router}",
    ]
    with zenoh.open(config) as session, subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as daemon:
        try:
            assert daemon.stderr
            name = next(line for line in daemon.stderr if "publishing" in line).split("'")[1]
            threading.Thread(target=daemon.stderr.read, daemon=True).start()
            with gellight.subscribe(name) as frames:
                depth_mm = frames.next_frame(PATIENCE_S).depth_mm
            bar = depth_bar(depth_mm.shape[0], 70)
            write_png(FOLDER / "live.png", np.hstack([depth_picture(depth_mm), bar]))
            image = received(session, "image_raw", "sensor_msgs/msg/Image")
            points = received(session, "points", "sensor_msgs/msg/PointCloud2")
            colours = image.data.reshape(image.height, image.width, 3)  # type: ignore[attr-defined]
            places = points.data.view("<f4").reshape(*colours.shape)  # type: ignore[attr-defined]
            both = np.hstack([colours, drawn(places, colours)])
            write_png(FOLDER / "ros2.png", cv2.resize(both, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
        finally:
            daemon.terminate()


def received(session: zenoh.Session, topic: str, kind: str) -> object:
    """Return the next message of a topic, as ROS 2 decodes it."""
    came: list[bytes] = []
    there = threading.Event()

    def note(sample: zenoh.Sample) -> None:
        came.append(sample.payload.to_bytes())
        there.set()

    held = session.declare_subscriber(f"0/*/{topic}/**", note)
    assert there.wait(PATIENCE_S), f"nothing came on {topic}"
    held.undeclare()
    return STORE.deserialize_cdr(came[0], kind)


def drawn(points_m: NDArray[np.float32], colours: Picture) -> Picture:
    """Draw (H, W, 3) points, m, from the side, each in the colour of its pixel; what is behind comes first."""
    height, width, _ = colours.shape
    x, y, z = np.moveaxis(points_m[::2, ::2].reshape(-1, 3).astype(float), 1, 0)
    across, along = np.cos(TURN) * x - np.sin(TURN) * y, np.sin(TURN) * x + np.cos(TURN) * y
    up = np.cos(TILT) * STRETCH * z + np.sin(TILT) * along
    order = np.argsort(-along)
    picture = np.full(colours.shape, PAPER, np.uint8)
    places = np.column_stack([width / 2 + POINT_SCALE * across, 0.6 * height - POINT_SCALE * up]).astype(int)[order]
    for place, colour in zip(places.tolist(), colours[::2, ::2].reshape(-1, 3)[order].tolist(), strict=True):
        cv2.circle(picture, place, 1, colour, -1)
    return picture


if __name__ == "__main__":
    main()
