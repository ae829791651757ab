"""The store reads a bundle once and checks what it has written; what a bundle must have reached on fresh presses."""

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gellight.base.errors import BundleError
from gellight.bundle import bundle as bundle_module
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.bundle.limits import Limits
from gellight.bundle.store import BundleStore
from gellight.daemon.installing import install, restore
from tests.helpers.linear_sensor import verified_bundle


@pytest.fixture
def loads(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Where each bundle was loaded from, one entry a load."""
    found: list[str] = []
    load = bundle_module._load

    def counting(source: str, read: object) -> Bundle:
        found.append(Path(source).name)
        return load(source, read)  # type: ignore[arg-type]

    monkeypatch.setattr(bundle_module, "_load", counting)
    return found


def filled(folder: Path, count: int) -> list[Bundle]:
    made = [verified_bundle(folder / f"made {number}") for number in range(count)]
    for bundle in made:
        install(bundle, sensor="GL-7", store=BundleStore(folder / "store"))
    return made


def test_a_list_loads_each_bundle_once_and_again_only_after_a_change(tmp_path: Path, loads: list[str]) -> None:
    filled(tmp_path, 5)
    loads.clear()
    store = BundleStore(tmp_path / "store")
    first = store.bundles("GL-7")
    assert len(loads) == len(first) == 5
    for _ in range(10):
        assert store.bundles("GL-7") == first
    assert len(loads) == 5
    network = first[2].path / "network.onnx"
    content = network.read_bytes()
    network.write_bytes(content[:-1] + b"x")
    assert "changed after calibration" in store.bundles("GL-7")[-1].problem, "one that cannot be read is the last"
    assert loads[5:] == [first[2].identity]
    network.write_bytes(content)
    os.utime(network, ns=(1, 1))
    assert store.bundles("GL-7") == first


def test_what_is_in_service_is_listed_without_loading_and_an_installation_loads_its_own(
    tmp_path: Path, loads: list[str]
) -> None:
    made = filled(tmp_path, 2)
    store = BundleStore(tmp_path / "store")
    assert [entry.in_service for entry in store.bundles("GL-7")].count(True) == 1
    loads.clear()
    store.put_in_service(store.find(made[0].identity))
    assert {entry.identity for entry in store.bundles() if entry.in_service} == {made[0].identity}
    assert loads == []
    first, _ = made
    third = verified_bundle(tmp_path / "third")
    loads.clear()
    install(third, sensor="GL-7", store=store)
    assert loads == [third.identity]
    restore(first.identity, sensor="GL-7", store=store)
    assert loads[1:] == [first.identity]
    restore("", sensor="GL-7", store=store)
    assert loads[2:] == [third.identity]


def test_a_damaged_bundle_is_replaced_when_it_is_installed_again(tmp_path: Path) -> None:
    (bundle,) = filled(tmp_path, 1)
    store = BundleStore(tmp_path / "store")
    (store.find(bundle.identity).path / "network.onnx").write_bytes(b"rust")
    install(bundle, sensor="GL-7", store=store)
    assert load_bundle(store.current("GL-7").path).files == bundle.files
    assert store.bundles()[0].problem == ""


@pytest.mark.parametrize(
    ("figures", "told"),
    [
        ({"depth_mm": 0.08, "normal_deg": 7.0}, ""),
        ({"depth_mm": 0.08, "true_depth_mm": 0.08, "normal_deg": 2.0}, ""),
        ({"depth_mm": 0.081, "normal_deg": 2.0}, r"\(shape of the depth 81 um with the mean error of each press taken"),
        ({"depth_mm": 0.02, "normal_deg": 7.1}, "normals 7.1 degrees"),
        ({"depth_mm": 0.02, "true_depth_mm": 0.081, "normal_deg": 2.0}, r"\(depth 81 um; 20 um with the mean error"),
        ({"depth_mm": 0.081, "true_depth_mm": 0.02, "normal_deg": 2.0}, r"\(depth 20 um; 81 um with the mean error"),
        ({}, "was never verified on fresh presses"),
        ({"depth_mm": 0.02}, "was never verified on fresh presses"),
        ({"depth_mm": "good", "normal_deg": 2.0}, "was never verified on fresh presses"),
        (None, "was never verified on fresh presses"),
    ],
)
def test_only_a_bundle_within_the_limits_passes(figures: object, told: str) -> None:
    bundle: Any = SimpleNamespace(metrics={"verification": figures}, source="my-sensor")
    if not told:
        Limits().check(bundle)
        return
    with pytest.raises(BundleError, match=told):
        Limits().check(bundle)
