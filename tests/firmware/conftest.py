"""Fixtures: the core as a library, the committed image on an emulated board, a light ring on it."""

import ctypes
import importlib.util
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from gellight.ring.emulator.chip import EmulatedBoard
from gellight.ring.firmware.build import committed_image
from gellight.ring.light_ring import LightRing
from gellight.ring.transport import VirtualTransport


def _sibling(name: str) -> ModuleType:
    """Import a file next to this one: pytest's importlib mode puts no test folder on the path."""
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
        assert spec
        assert spec.loader
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
    return sys.modules[name]


_sibling("virtual_board")
_sibling("core_model")
_sibling("mutations")
_sibling("fuzzing")
_sibling("stack_bound")


@pytest.fixture(scope="session")
def core_library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The core under UBSan; under ASan too where the environment names such a library."""
    from virtual_board import compile_library, load

    given = os.environ.get("GELLIGHT_CORE_LIBRARY")
    return load(given or str(compile_library(tmp_path_factory.mktemp("core") / "core.so", "undefined")))


@pytest.fixture
def core(core_library: ctypes.CDLL) -> Iterator[object]:
    from virtual_board import VirtualBoard

    board = VirtualBoard(core_library)
    yield board
    board.close()


@pytest.fixture(scope="session")
def image() -> bytes:
    return committed_image()


@pytest.fixture
def board(image: bytes) -> Iterator[EmulatedBoard]:
    """The committed image with power; at the end it must not have broken a rule of the silicon or of the LEDs."""
    emulated = EmulatedBoard(image)
    yield emulated
    assert emulated.faults == []


@pytest.fixture
def ring(board: EmulatedBoard) -> Iterator[LightRing]:
    with LightRing(VirtualTransport(board), keep_alive_s=None) as opened:
        yield opened
