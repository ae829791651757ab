"""Who may import what, where import-linter (its contracts stand in pyproject.toml) cannot say it.

An import counts wherever it stands: at the top, inside a function, under TYPE_CHECKING, by `import_module`.
"""

import ast
import functools
import importlib.metadata
import re
import sys
import tomllib
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp
import pytest
from packaging.utils import canonicalize_name

from tests.helpers.places import CHECKOUT
from tests.release.licences import PROJECT, closure

HOST, TESTS = CHECKOUT / "host/gellight", CHECKOUT / "tests"
GRAPH = grimp.build_graph("gellight", "gelnet", "sim_reference", include_external_packages=True, cache_dir=None)
CONTRACTS = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
ROOMS = [layer for layer in reversed(CONTRACTS[0]["layers"]) if layer != "opening"]
RUN = [room for room in [*ROOMS, "reconstruction.native"] if not room.startswith(("lab.", "cli"))]
TORCH_FILES = {"gelnet.network", "gelnet.torch_trainer"}
"""everything else of gelnet works without torch"""
DOORS = {
    "sim_reference": ("lab/simulator/",),
    "cv2": (
        "bundle/contents.py", "lab/optics/lens/pins.py", "dashboard/view.py",
        "frames/dots.py", "frames/dot_places.py",
        "frames/image_files.py", "frames/jpeg.py", "frames/pixel_grid.py",
        "frames/video_files.py", "frames/view.py",
        "reconstruction/confidence.py", "reconstruction/force.py",
        "reconstruction/integration.py", "reconstruction/lens/undistortion.py", "reconstruction/skirt.py",
        "reconstruction/cast_shadows.py", "reconstruction/smoothing.py",
        "series/reconstructor.py", "lab/report/pictures.py",
        "sensor/opencv_camera.py", "sensor/v4l2/formats.py",
        "recording/frame_record.py",
    ),
    "onnxruntime": ("reconstruction/network_session.py",),
    "serial": ("ring/transport.py", "ring/firmware/flash.py"),
    "usb": ("ring/firmware/flash.py",),
    "aiohttp": ("dashboard/",),
    "zenoh": ("stream/",),
    "mcap": ("recording/recording_file.py",),
    "typer": ("cli/",),
    "rich": ("cli/",),
}  # fmt: skip
"""the only files, or folders, of the host that import a package"""
OPEN_CALLS = {"__init__.py", "cli/lazy.py"}
"""files of the host whose `import_module` gets a name that is computed: public names, and verbs, on first use"""


def of(package: str) -> list[str]:
    return sorted(module for module in GRAPH.modules if module.split(".")[0] == package)


def external(module: str) -> set[str]:
    """Return the top names of what a module imports."""
    return {name.split(".")[0] for name in GRAPH.find_modules_directly_imported_by(module)}


def path_of(module: str) -> str:
    name = module.removeprefix("gellight").removeprefix(".").replace(".", "/")
    return f"{name}.py" if (HOST / f"{name}.py").is_file() else f"{name}/__init__.py".removeprefix("/")


def room(module: str) -> str:
    """Return the room of a module of the host: the folder, or the file itself where it lies in the root."""
    names = module.split(".")[1:]
    return ".".join(names[:2]) if names[0] == "lab" or ".".join(names[:2]) in RUN else names[0]


def test_the_reference_imports_only_numpy_and_scipy() -> None:
    allowed = {"numpy", "scipy", "sim_reference"} | sys.stdlib_module_names
    assert {module: external(module) - allowed for module in of("sim_reference") if external(module) - allowed} == {}


def test_torch_is_imported_only_where_it_is_asked_for() -> None:
    assert {module for module in of("gelnet") if "torch" in external(module)} == TORCH_FILES


def test_a_package_is_imported_only_where_its_doors_are_and_every_door_is_used() -> None:
    for package, doors in DOORS.items():
        users = {path_of(module) for module in of("gellight") if package in external(module)}
        assert {name for name in users if not name.startswith(doors)} == set(), f"{package} has its doors in {doors}"
        assert [door for door in doors if not any(name.startswith(door) for name in users)] == [], package


MODULES = [module for module in of("gellight") if module not in ("gellight", "gellight.lab")]


def test_every_file_of_the_host_is_in_a_room() -> None:
    assert {room(module) for module in MODULES} == {*ROOMS, "opening", "reconstruction.native"}


def test_the_reconstruction_does_not_know_its_twin_in_c() -> None:
    users = [module for module in MODULES if room(module) == "reconstruction"]
    assert [m for m in users for o in GRAPH.find_modules_directly_imported_by(m) if ".native" in o] == []


def test_a_reader_of_the_running_half_meets_at_most_nine_floors() -> None:
    below: dict[str, set[str]] = {name: set() for name in RUN}
    for module in MODULES:
        if room(module) in below:
            others = GRAPH.find_modules_directly_imported_by(module) & set(MODULES)
            below[room(module)] |= {room(other) for other in others} & set(RUN) - {room(module)}

    @functools.cache
    def floor(name: str) -> int:
        return 1 + max((floor(other) for other in below[name]), default=0)

    assert max(map(floor, RUN)) <= 9, {name: floor(name) for name in RUN}


@pytest.mark.parametrize("package", ["gellight", "gelnet", "sim_reference"])
def test_no_imports_go_round_in_a_circle(package: str) -> None:
    known = set(of(package))
    graph = {one: (GRAPH.find_modules_directly_imported_by(one) & known) - {one, package} for one in known}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def by_name(path: Path) -> list[str]:
    """Return what the calls of `import_module` in a file name; "?" where it is computed."""
    calls = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
    named = [call for call in calls if ast.unparse(call.func).split(".")[-1] in ("import_module", "__import__")]
    return [str(getattr(call.args[0], "value", "?")) if call.args else "?" for call in named]


def test_imports_by_name_are_computed_only_where_that_is_known_and_name_nothing_that_has_a_door() -> None:
    found = {path.relative_to(HOST).as_posix(): by_name(path) for path in HOST.rglob("*.py")}
    assert {name for name, named in found.items() if "?" in named} == OPEN_CALLS
    ours = {name: named for name, named in found.items() for one in named if one.split(".")[0] in ("torch", "gelnet")}
    assert ours == {}
    for name, named in found.items():
        for package in {one.split(".")[0] for one in named} & DOORS.keys():
            assert name.startswith(DOORS[package]), f"{name} imports {package}"


def test_imports_are_absolute() -> None:
    assert [path for path in HOST.rglob("*.py") if re.search(r"^\s*from \.", path.read_text(), re.MULTILINE)] == []


PLANTED = "def f():\n    importlib.import_module('gellight.opening')\n    import_module(name)\n"


def test_an_import_by_name_is_seen_wherever_it_stands(tmp_path: Path) -> None:
    (tmp_path / "planted.py").write_text(PLANTED)
    assert by_name(tmp_path / "planted.py") == ["gellight.opening", "?"]


def test_the_tests_of_the_host_lie_in_folders_named_as_its_rooms() -> None:
    tests = (path.relative_to(TESTS / "host") for path in (TESTS / "host").glob("*/**/*.py"))
    assert {room(".".join(("tests", *path.parts))) for path in tests} <= {*ROOMS, "reconstruction.native"}
    assert [path.name for path in (TESTS / "host").glob("*.py") if path.name != "conftest.py"] == []


def test_no_test_imports_another_test_file() -> None:
    for path in TESTS.rglob("*.py"):
        statements = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
        shared = [node.module.split(".") for node in statements if (node.module or "").startswith("tests.")]
        assert not [name for name in shared if name[-1].startswith("test_") or "conftest" in name], path


OF_A_NIGHT = {"atheris", "drjit", "mitsuba"}
"""packages of files that a daily test never imports"""
BESIDE = ("gellight_design", "gellight_ros", "gellight_scan", "gellight_touch")


def test_what_a_file_of_tests_imports_at_its_top_comes_with_what_every_day_installs() -> None:
    installed = closure([*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["test"], *BESIDE])
    by_name = importlib.metadata.packages_distributions().items()
    brought = {name for name, brings in by_name if {*map(canonicalize_name, brings)} & installed.keys()}
    known = brought | sys.stdlib_module_names | {"firmware", "gellight", *BESIDE, "gelnet", "sim_reference", "tests"}
    at_the_top = [node for path in TESTS.rglob("*.py") for node in ast.parse(path.read_text()).body]
    names = {alias.name for node in at_the_top if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "" for node in at_the_top if isinstance(node, ast.ImportFrom)}
    assert {name.split(".")[0] for name in names} - known == OF_A_NIGHT


def test_helpers_lie_apart_from_the_tests() -> None:
    apart = {
        "helpers", "emulator", "virtual_usb", "benchmarks", "paper", "soak", "inside", "machine", "data",
        "release", "fuzz",
    }  # fmt: skip
    beside = [path for path in TESTS.glob("*/**/*.py") if not apart & set(path.relative_to(TESTS).parts)]
    assert [path for path in beside if not path.name.startswith("test_") and path.name != "conftest.py"] == []
