"""What a release brings along: pinned with hashes, of known licences, listed in a bill of materials, and audited."""

import ctypes
import json
import os
import re
import sys
from email.message import Message
from importlib.metadata import Distribution
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement

from tests.helpers.children import run
from tests.helpers.places import CHECKOUT
from tests.release.audit import NOT_AUDITED
from tests.release.licences import ALLOWED, PROJECT, REASONS, allowed, libraries, licence, of_extras, shipped
from tests.release.sbom import PINNED

LOCK = PINNED.read_text()
PYTHONS = ("3.11", "3.12", "3.13", "3.14")


def outdated(lock: str) -> list[str]:
    """Return the requirements of pyproject.toml that a lock does not meet, or meets without a hash."""
    pins = [Requirement(line.rstrip(" \\")) for line in lock.splitlines() if "==" in line]
    wrong = []
    for need in map(Requirement, PROJECT["dependencies"]):
        for python in PYTHONS:
            system = {"python_version": python, "python_full_version": f"{python}.0"}
            here = [p for p in pins if p.name == need.name and (not p.marker or p.marker.evaluate(system))]
            if [need.specifier.contains(next(iter(p.specifier)).version) for p in here] != [True]:
                wrong.append(f"{need} on {python}")
    blocks = re.split(r"\n(?=\S)", re.sub(r"^#.*\n", "", lock, flags=re.MULTILINE).strip())
    return wrong + [block.split()[0] for block in blocks if "--hash=sha256:" not in block]


def test_the_lock_is_of_what_the_project_needs_now() -> None:
    assert outdated(LOCK) == []
    assert set(re.findall(r"^(\S+)==", LOCK, re.MULTILINE)) - {"colorama"} == set(shipped())


@pytest.mark.parametrize(
    ("text", "instead"),
    [
        ("pyusb==1", "pyusc==1"),
        ("pyserial==3", "pyserial==2"),
        ("--hash=sha256:", "--hash=md5:"),
        (" < '3.12'", " < '3.11'"),
    ],
)
def test_a_lock_that_is_not_of_now_is_noticed(text: str, instead: str) -> None:
    assert text in LOCK
    assert outdated(LOCK.replace(text, instead)) != []


@pytest.mark.nightly
def test_every_package_that_ships_and_every_extra_has_a_licence_that_fits() -> None:
    told = {name: licence(found) for name, found in {**shipped(), **of_extras()}.items()}
    assert {name: text for name, text in told.items() if not allowed(text)} == {}


@pytest.mark.nightly
def test_every_library_inside_a_wheel_has_a_licence_that_fits() -> None:
    inside = {(package, name): text for package, found in shipped().items() for name, text in libraries(found).items()}
    assert len(inside) > 10
    assert {of: text for of, text in inside.items() if not (text in REASONS or allowed(text))} == {}
    assert {text for text in inside.values() if text not in ALLOWED} == set(REASONS)


def test_ffmpeg_inside_opencv_says_itself_that_it_is_not_under_the_gpl() -> None:
    import cv2  # its libraries are loaded with it

    assert cv2.__version__
    (path,) = (line.split()[-1] for line in _mapped() if "libavutil" in line)
    of = ctypes.CDLL(path).avutil_license
    of.restype = ctypes.c_char_p
    assert of() == b"LGPL version 2.1 or later"


def _mapped() -> set[str]:
    return {re.sub(r"^.* ", "", line) for line in Path("/proc/self/maps").read_text().splitlines()}


class Named(Distribution):
    def __init__(self, **told: str) -> None:
        self.told = Message()
        for name, value in {"Name": "it", **told}.items():
            self.told[name.replace("_", "-")] = value

    @property
    def metadata(self) -> Any:
        from importlib.metadata._adapters import Message as Metadata

        return Metadata(self.told)

    def read_text(self, filename: str) -> str | None: ...

    def locate_file(self, path: Any) -> Any: ...


@pytest.mark.parametrize(
    "told",
    [
        {}, {"License": "GPLv3"}, {"License_Expression": "MIT AND GPL-3.0-only"}, {"License_Expression": "AGPL-3.0"},
        {"Classifier": "License :: OSI Approved :: GNU General Public License v2 (GPLv2)"}, {"License": "proprietary"},
    ],
)  # fmt: skip
def test_a_licence_that_does_not_fit_is_noticed(told: dict[str, str]) -> None:
    assert not allowed(licence(Named(**told)))


@pytest.mark.nightly
def test_the_bill_of_materials_lists_what_ships_with_hashes_and_licences(tmp_path: Path) -> None:
    run([sys.executable, "-m", "tests.release.sbom", tmp_path / "bill.json"], cwd=CHECKOUT, check=True)
    bill = json.loads((tmp_path / "bill.json").read_text())
    assert (bill["bomFormat"], bill["metadata"]["component"]["name"]) == ("CycloneDX", "gellight")
    assert bill["metadata"]["component"]["version"] == PROJECT["version"]
    listed = {component["name"] for component in bill["components"]}
    assert set(shipped()) <= listed
    assert not listed & {"torch", "pytest", "unicorn", "hypothesis"}
    for component in bill["components"]:
        assert component["externalReferences"][0]["hashes"], component["name"]
        assert component["licenses"], component["name"]
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(json.dumps(bill)) is None


@pytest.mark.nightly
def test_an_audit_that_could_not_ask_says_so_and_does_not_pass() -> None:
    proxies = dict.fromkeys(("HTTPS_PROXY", "https_proxy"), "http://127.0.0.1:9")
    done = run([sys.executable, "-m", "tests.release.audit"], cwd=CHECKOUT, env=os.environ | proxies)
    assert done.returncode == NOT_AUDITED
    assert done.stdout.startswith("NOT AUDITED: requirements.txt")
