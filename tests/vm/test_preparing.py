"""What is made ready before the guest starts; these tests start none."""

import lzma
import subprocess
from pathlib import Path

import pytest

from tests.vm.machine import initramfs, packages
from tests.vm.machine.modules import content, load_order


def module(path: Path, depends: str, *, compressed: bool = False) -> None:
    """A file that says of itself what kernel modules say."""
    data = b"\x7fELF...\0license=GPL\0depends=" + depends.encode() + b"\0name=x\0"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(lzma.compress(data) if compressed else data)


def test_modules_load_after_those_that_they_need(tmp_path: Path) -> None:
    module(tmp_path / "usb/uvcvideo.ko", "videobuf2-v4l2,usbcore,mc")
    module(tmp_path / "media/videobuf2-v4l2.ko.xz", "videobuf2-common", compressed=True)
    module(tmp_path / "media/videobuf2-common.ko", "mc")
    module(tmp_path / "media/mc.ko", "")
    names = [path.name for path in load_order(tmp_path, ["uvcvideo", "mc"])]
    assert names == ["mc.ko", "videobuf2-common.ko", "videobuf2-v4l2.ko.xz", "uvcvideo.ko"], "usbcore is built in"
    assert content(tmp_path / "media/videobuf2-v4l2.ko.xz").startswith(b"\x7fELF")


def test_the_first_file_system_can_be_read_by_others(tmp_path: Path) -> None:
    busybox, driver = tmp_path / "busybox", tmp_path / "9p.ko"
    busybox.write_bytes(b"program")
    module(driver, "")
    (tmp_path / "initramfs.gz").write_bytes(initramfs.build([driver], busybox))
    program = packages.unpacked() / "tools/usr/bin/busybox"
    listed = subprocess.run(
        [str(program if program.exists() else "busybox"), "cpio", "-t"],
        input=subprocess.run(["gzip", "-dc", tmp_path / "initramfs.gz"], capture_output=True, check=True).stdout,
        capture_output=True, check=True,
    ).stdout.decode().split()  # fmt: skip
    assert {"init", "bin/busybox", "modules/00-9p.ko", "root"} <= set(listed)


def test_a_machine_without_apt_is_told_in_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(packages.Missing, match=r"needs apt-cache: on Debian: sudo apt-get update") as missing:
        packages.unpacked()
    assert "\n" not in str(missing.value)


def test_a_kernel_that_the_lists_do_not_know_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packages, "KERNEL", "linux-image-of-nobody")
    monkeypatch.setattr(packages.os, "geteuid", lambda: 1000)
    with pytest.raises(packages.Missing, match="apt-get update"):
        packages.unpacked()
