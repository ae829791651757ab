"""Finite elements that do not fit the memory are refused before a mesh is made."""

from pathlib import Path

import pytest

from gellight.base.errors import InputError
from gellight.lab.simulator import memory
from gellight.lab.simulator.memory import check_memory, free_memory
from gellight.opening import open_camera
from sim_reference.geometry import SensorGeometry

GEOMETRY = SensorGeometry()


def test_a_mesh_is_refused_that_the_memory_does_not_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "free_memory", lambda: 10 * 10**9)
    check_memory(0.3, GEOMETRY)
    check_memory(0.1, GEOMETRY)
    with pytest.raises(InputError, match=r"0\.1 mm in each of 2 --workers needs about .* GB .*: 0\.1\d mm fits"):
        check_memory(0.1, GEOMETRY, 2)
    with pytest.raises(InputError, match="use fewer --workers"):
        check_memory(0.3, GEOMETRY, 100)
    monkeypatch.setattr(memory, "free_memory", lambda: 10**9)
    with pytest.raises(InputError, match=r"0\.3 mm needs about 1\.\d GB .*: 0\.\d+ mm fits"):
        check_memory(0.3, GEOMETRY)
    with pytest.raises(InputError, match=r"0\.3 mm needs about"):
        open_camera("sim://?board=0&gel=fem")


def test_what_the_kernel_keeps_of_files_is_free(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    meminfo = tmp_path / "meminfo"
    meminfo.write_text("MemTotal:       16000000 kB\nMemFree:          200000 kB\nMemAvailable:   12000000 kB\n")
    monkeypatch.setattr(memory, "MEMINFO", meminfo)
    assert free_memory() == 12_000_000 * 1024
    monkeypatch.setattr(memory, "MEMINFO", tmp_path / "none")
    assert free_memory() > 10**8
