"""Show that the topics of `stream.ros2` arrive, without ROS; needs `pip install rosbags`."""

import sys
import threading
import time

import zenoh
from rosbags.typesys import Stores, get_typestore

router = sys.argv[1] if sys.argv[1:] else "tcp/localhost:7447"
known = get_typestore(Stores.ROS2_JAZZY)
came: dict[str, str] = {}
enough = threading.Event()


def note(sample: zenoh.Sample) -> None:
    """Read a message as ROS 2 does; its key says domain, topic, type and hash."""
    _, *topic, kind, _ = str(sample.key_expr).split("/")
    kind = kind.replace("::msg::dds_::", "/msg/").rstrip("_")
    message = known.deserialize_cdr(sample.payload.to_bytes(), kind)
    came["/" + "/".join(topic)] = f"{kind}, stamped {message.header.stamp.sec} s"
    if len(came) >= 6:
        enough.set()


config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["{router}"]')
config.insert_json5("connect/timeout_ms", "60000")  # as long as the sensor may take to start
config.insert_json5("connect/exit_on_failure", "true")
try:
    session = zenoh.open(config)
except zenoh.ZError:
    sys.exit(f"no router answers at {router}: start `gellight run --set stream.ros2={router}`")
with session:
    held = session.declare_subscriber("0/**", note)
    enough.wait(20)
    time.sleep(1)  # for the topics that say something once a second
    held.undeclare()
for topic, said in sorted(came.items()):
    print(f"{topic}: {said}")
sys.exit(0 if came else "nothing arrived")
