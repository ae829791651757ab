"""A URL names the camera: one of ours, one of another distribution, or files."""

from types import SimpleNamespace
from typing import Any

import pytest

from gellight import opening
from gellight.base.errors import CameraError, InputError
from gellight.opening import open_camera
from tests.helpers.scripted_camera import ScriptedCamera


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The schemes for which another distribution was looked for; there is one that speaks grey://."""
    names: list[str] = []

    def entry_points(*, group: str, name: str) -> list[Any]:
        names.append(name)
        return [SimpleNamespace(load=lambda: lambda url: ScriptedCamera(url=url))] if name == "grey" else []

    monkeypatch.setattr(opening, "entry_points", entry_points)
    return names


def test_a_scheme_of_another_distribution_opens_its_camera(asked: list[str]) -> None:
    with open_camera("grey://127") as camera:
        assert camera.url == "grey://127"
    assert asked == ["grey"]


def test_a_scheme_that_nobody_speaks_is_named(asked: list[str]) -> None:
    with pytest.raises(CameraError, match=r"no camera speaks gray:// \(in 'gray://127'\)"):
        open_camera("gray://127")
    assert asked == ["gray"]


def test_files_are_nobodys_scheme(asked: list[str]) -> None:
    with pytest.raises((CameraError, InputError), match="grey"):
        open_camera("grey")
    assert not asked
