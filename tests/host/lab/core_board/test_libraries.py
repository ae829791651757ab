"""The libraries of the simulated board: built from the firmware, whole, and refused where they are not."""

import platform
import sys
from pathlib import Path

import pytest

from firmware.tools.libraries import BOARDS, board
from gellight.base.errors import BoardError
from gellight.lab.core_board import core
from gellight.lab.core_board.simulated_board import SimulatedBoard
from gellight.reconstruction.native.library import check_whole

HERE = f"{sys.platform}-{platform.machine()}"


@pytest.mark.nightly
def test_the_committed_libraries_are_built_from_the_sources() -> None:
    """The same bytes from the same compiler, on any machine."""
    for name in BOARDS:
        assert board(name) == core.library_file(name).read_bytes(), f"{name}: build the libraries again"


def test_every_library_is_whole_and_of_its_system() -> None:
    for name in BOARDS:
        check_whole(core.library_file(name), core.CHECKSUMS)
        content = core.library_file(name).read_bytes()
        assert content.startswith(b"\x7fELF" if name.startswith("linux") else b"\xcf\xfa\xed\xfe")
        assert all(f"board_{function}".encode() in content for function in core._FUNCTIONS)
        assert name.startswith("darwin") or b"libc" not in content


@pytest.fixture
def another_library(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    monkeypatch.setattr("gellight.lab.core_board.simulated_board.packaged_library", core.packaged_library.__wrapped__)
    return monkeypatch


def test_a_damaged_library_is_not_loaded(another_library: pytest.MonkeyPatch, tmp_path: Path) -> None:
    broken = tmp_path / core.library_file(HERE).name
    broken.write_bytes(core.library_file(HERE).read_bytes()[:-1])
    another_library.setattr(core, "library_file", lambda name: broken)
    with pytest.raises(BoardError, match=r"is damaged.*install gellight again"):
        SimulatedBoard()


def test_a_machine_without_a_library_has_steady_light(another_library: pytest.MonkeyPatch) -> None:
    another_library.setattr(platform, "machine", lambda: "riscv64")
    with pytest.raises(BoardError, match=r"on riscv64: give sim://\?board=0"):
        SimulatedBoard()
