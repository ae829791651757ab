"""Fixtures: the core as a library, the committed image on an emulated board, a light ring on it."""

import ctypes
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from gellight.ring.firmware.targets import committed_image
from gellight.ring.light_ring import LightRing
from tests.firmware.helpers.virtual_board import VirtualBoard, compile_library, load
from tests.helpers.bench_board import BenchBoard, VirtualTransport
from tests.helpers.places import CHECKOUT


@pytest.fixture(scope="session")
def core_library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The core under UBSan; under ASan too where the environment names such a library."""
    given = os.environ.get("GELLIGHT_CORE_LIBRARY")
    return load(given or str(compile_library(tmp_path_factory.mktemp("core") / "core.so", "undefined")))


@pytest.fixture
def core(core_library: ctypes.CDLL) -> VirtualBoard:
    return VirtualBoard(core_library)


@pytest.fixture(scope="session")
def copied_firmware(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the firmware, in which faults are planted."""
    folder = tmp_path_factory.mktemp("checkout")
    shutil.copytree(CHECKOUT / "firmware", folder / "firmware")
    return folder


@pytest.fixture(scope="session")
def image() -> bytes:
    return committed_image()


@pytest.fixture
def board(image: bytes) -> Iterator[BenchBoard]:
    """The committed image with power; at the end it must not have broken a rule of the silicon or of the LEDs."""
    emulated = BenchBoard(image)
    yield emulated
    assert emulated.faults == []


@pytest.fixture
def ring(board: BenchBoard) -> Iterator[LightRing]:
    with LightRing(VirtualTransport(board), keep_alive_s=None) as opened:
        yield opened
