"""`gellight find`: which sensors, cameras and light rings are plugged in."""

from collections.abc import Iterator

from gellight.cli.options import AsJson
from gellight.cli.showing import show
from gellight.sensor.discovery import NOTHING, SEE_SIMULATED, Discovery, Node, discover


def command(as_json: AsJson = False) -> None:
    """List the sensors, cameras and light rings that are there."""
    found = discover()
    show(as_dictionary(found), as_json, "\n".join(lines(found)))


def lines(found: Discovery) -> Iterator[str]:
    """Yield what was found, a line each."""
    if found.empty:
        yield f"{NOTHING}: {SEE_SIMULATED}"
    for sensor in found.sensors:
        ring = sensor.ring.path if sensor.ring else "none"
        yield (
            f"{found.url_of(sensor)}   USB {sensor.port}, camera {sensor.camera.path}, {sensor.camera.name}, "
            f"ring {ring}"
        )
    for kind, nodes in (("camera without a ring", found.cameras), ("ring without a camera", found.rings)):
        for node in nodes:
            yield f"{kind}: {node.stable}   {node.name}" + (f", USB {node.usb.port}" if node.usb else "")
    for text in found.ambiguities:
        yield f"ambiguous: {text}"


def as_dictionary(found: Discovery) -> dict[str, object]:
    """Return everything by name, ready for JSON."""
    return {
        "sensors": [
            {"url": found.url_of(sensor), "serial": sensor.serial, "port": sensor.port,
             "camera": _node(sensor.camera), "ring": _node(sensor.ring) if sensor.ring else None}
            for sensor in found.sensors
        ],
        "cameras": [_node(node) for node in found.cameras],
        "rings": [_node(node) for node in found.rings],
        "ambiguities": list(found.ambiguities),
    }  # fmt: skip


def _node(node: Node) -> dict[str, object]:
    speed = node.usb.speed_mbps if node.usb else None
    port = node.usb.port if node.usb else None
    return {"path": node.path, "stable": node.stable, "name": node.name, "port": port, "speed_mbps": speed}
