"""A sysfs and a /dev made of files: USB devices with cameras and light rings, to plug in and to pull out."""

import shutil
from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class UsbTree:
    """A tree below `root`; `sysfs` and `dev` are what discovery reads."""

    root: Path
    plugged: dict[str, list[Path]] = field(default_factory=dict)
    numbers: int = 0

    def __post_init__(self) -> None:
        for name in ("sys/class/video4linux", "sys/class/tty", "dev/v4l/by-id", "dev/serial/by-id"):
            (self.root / name).mkdir(parents=True)

    @property
    def sysfs(self) -> Path:
        return self.root / "sys"

    @property
    def dev(self) -> Path:
        return self.root / "dev"

    def plug(
        self, port: str, *, serial: str = "", ids: tuple[int, int] = (0x1209, 1), cameras: int = 0, rings: int = 0,
        speed: str = "480", refused: bool = False,
    ) -> list[str]:  # fmt: skip
        """Put a device at a port such as 1-1.4; return the nodes of its cameras, then of its rings.

        `refused`: the kernel has not configured it.
        """
        device = self._folder(port)
        device.mkdir(parents=True)
        attributes = {"idVendor": f"{ids[0]:04x}", "idProduct": f"{ids[1]:04x}", "serial": serial,
                      "product": "Tactile sensor", "manufacturer": "GelLight", "speed": speed,
                      "bConfigurationValue": "" if refused else "1"}  # fmt: skip
        for name, value in attributes.items():
            (device / name).write_text(f"{value}\n")
        entry = self.sysfs / "bus/usb/devices" / port
        entry.parent.mkdir(parents=True, exist_ok=True)
        if not entry.is_symlink():
            entry.symlink_to(device)
        made = self.plugged.setdefault(port, [device])
        nodes = []
        for _ in range(cameras):
            nodes.append(self._node(made, device, "video4linux", "video", 0))
            self._node(made, device, "video4linux", "video", 1)  # the metadata of a UVC camera
            if serial:
                self._link(made, f"v4l/by-id/usb-GelLight_{serial}-video-index0", nodes[-1])
        nodes += [self._node(made, device, "tty", "ttyACM", 0) for _ in range(rings)]
        return nodes

    def unplug(self, port: str) -> None:
        """Take the device at a port away, with its nodes."""
        device, *others = self.plugged.pop(port)
        for path in others:
            path.unlink()
        shutil.rmtree(device)

    def _folder(self, port: str) -> Path:
        bus, _, ports = port.partition("-")
        hubs = [f"{bus}-{'.'.join(ports.split('.')[: count + 1])}" for count in range(len(ports.split(".")))]
        return self.root.joinpath("sys/devices/pci0000:00", f"usb{bus}", *hubs)

    def _node(self, made: list[Path], device: Path, kind: str, prefix: str, index: int) -> str:
        name = f"{prefix}{self.numbers}"
        self.numbers += 1
        folder = device / f"{device.name}:1.{index}" / kind / name
        folder.mkdir(parents=True)
        (folder / "index").write_text(f"{index}\n")
        (folder / "name").write_text("Tactile sensor: camera\n")
        entry, node = self.sysfs / "class" / kind / name, self.dev / name
        entry.symlink_to(folder)
        node.touch()
        made += [entry, node]
        return str(node)

    def _link(self, made: list[Path], name: str, node: str) -> None:
        link = self.dev / name
        if not link.is_symlink():
            link.symlink_to(node)
            made.append(link)
