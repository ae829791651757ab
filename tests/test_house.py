"""Who may import whom: the rooms of the house, over every import statement.

An import counts wherever it stands: at the top, inside a function, under TYPE_CHECKING, by `import_module`.
"""

import ast
import functools
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = {
    "gellight": ROOT / "host/gellight",
    "gelnet": ROOT / "models/gelnet",
    "sim_reference": ROOT / "sim_reference",
}
ROOMS = (
    "base", "ring", "bundle", "frames", "reconstruction", "report", "simulator", "sensor", "recording", "opening",
    "training", "watch", "design", "calibration", "daemon", "evaluation", "stream", "dashboard", "soak", "cli",
)  # fmt: skip
"""of the host, lowest first: a room imports from itself and from rooms before it"""
EXCEPTIONS: dict[tuple[str, str], str] = {}
"""(importing module, imported module): why it may go up; empty is best"""
TORCH_FILES = {"network.py", "torch_trainer.py"}
"""of gelnet: everything else there works without torch"""
FORBIDDEN_HOST = {"torch", "gelnet"}
DOORS = {
    "sim_reference": (
        "simulator/gel_models.py", "simulator/memory.py", "simulator/one_press.py", "simulator/read_noise.py",
        "simulator/scene.py", "simulator/selfcheck.py",
        "simulator/selfcheck_bounds.py", "simulator/simulated_camera.py", "simulator/stage.py", "design/",
        "cli/optimize.py", "cli/simulate.py", "cli/sweeping.py", "evaluation/dataset.py", "evaluation/demo_presses.py",
        "evaluation/synthetic.py", "evaluation/simulated_presses.py",
    ),
    "cv2": (
        "bundle/bundle.py", "calibration/lens/pins.py", "dashboard/view.py",
        "frames/dots.py", "frames/image_files.py", "frames/video_files.py", "frames/view.py",
        "reconstruction/cast_shadows.py", "reconstruction/integration.py", "reconstruction/lens/undistortion.py",
        "reconstruction/linearised.py", "reconstruction/smoothing.py",
        "reconstruction/photometric/reconstructor.py", "report/pictures.py", "report/video.py",
        "sensor/opencv_camera.py", "sensor/v4l2/decoding.py", "simulator/usb/encoding.py",
        "training/labelling/plate.py",
    ),
    "google": ("reconstruction/jacobian.py",),
    "onnx": ("reconstruction/jacobian.py",),
    "onnxruntime": ("reconstruction/network_session.py", "evaluation/frame_bench.py"),
    "serial": ("ring/transport.py", "ring/firmware/flash.py"),
    "usb": ("ring/transport.py", "ring/firmware/flash.py"),
    "aiohttp": ("dashboard/",),
    "zenoh": ("stream/",),
    "foxglove": ("stream/foxglove.py",),
    "mcap": ("recording/recording_file.py",),
    "typer": ("cli/",),
    "rich": ("cli/",),
    "ezdxf": ("design/",),
    "rp2040py": ("ring/emulator/",),
}  # fmt: skip
"""the only files, or folders, of the host that import a package"""
OPEN_CALLS = {
    "__init__.py": "the public names, imported when they are first used",
    "cli/lazy.py": "the verbs, imported when they are used",
}
"""files of the host whose `import_module` gets a name that is computed"""


def modules(package: str) -> dict[str, Path]:
    """Return the files of a package by the name they are imported by."""
    top = PACKAGES[package]
    return {
        ".".join((package, *path.relative_to(top).with_suffix("").parts)).removesuffix(".__init__"): path
        for path in sorted(top.rglob("*.py"))
    }


def imported(tree: ast.AST) -> Iterator[str]:
    """Yield what every import statement and every call of `import_module` names; "?" where it is computed."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{'.' * node.level}{node.module or ''}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Call) and called(node) in ("import_module", "__import__"):
            name = node.args[0] if node.args else None
            yield str(name.value) if isinstance(name, ast.Constant) else "?"


def called(node: ast.Call) -> str:
    """Return the last name of what is called."""
    return getattr(node.func, "id", getattr(node.func, "attr", ""))


@functools.cache
def imports(path: Path) -> frozenset[str]:
    """Return what a file imports, wherever the import stands; cached, as each of a thousand tests asks."""
    return frozenset(imported(ast.parse(path.read_text())))


def packages(path: Path) -> set[str]:
    """Return the top names of what a file imports."""
    return {name.split(".")[0] for name in imports(path)}


def graph(package: str) -> dict[str, set[str]]:
    """Return which modules of a package each of its modules imports."""
    known = modules(package)

    def home(name: str) -> str:
        """The module that a dotted name stands for or lies in: `from a.b import c` may name the module a.b.c."""
        return name if name in known else name.rpartition(".")[0]

    found = {module: {home(name) for name in imports(path)} & set(known) for module, path in known.items()}
    return {module: others - {module, package} for module, others in found.items()}


def room(module: str) -> str:
    """Return the room of a module of the host: the folder, or the file itself where it lies in the root."""
    return module.split(".")[1]


HOST = graph("gellight")
HOST_FILES = [path.relative_to(PACKAGES["gellight"]).as_posix() for path in modules("gellight").values()]


@pytest.mark.parametrize("path", modules("sim_reference").values(), ids=lambda p: p.name)
def test_the_reference_imports_only_numpy_and_scipy(path: Path) -> None:
    assert packages(path) <= {"numpy", "scipy", "sim_reference"} | sys.stdlib_module_names


@pytest.mark.parametrize("path", modules("gelnet").values(), ids=lambda p: p.name)
def test_training_never_imports_the_host(path: Path) -> None:
    assert "gellight" not in packages(path)


def test_torch_is_imported_only_where_it_trains() -> None:
    assert {path.name for path in modules("gelnet").values() if "torch" in packages(path)} == TORCH_FILES


@pytest.mark.parametrize("name", HOST_FILES)
def test_the_host_never_imports_training(name: str) -> None:
    assert not packages(PACKAGES["gellight"] / name) & FORBIDDEN_HOST


@pytest.mark.parametrize("name", HOST_FILES)
def test_a_package_is_imported_only_where_its_door_is(name: str) -> None:
    used = packages(PACKAGES["gellight"] / name)
    for package, doors in DOORS.items():
        assert package not in used or name.startswith(doors), f"{package} may only be imported in {doors}"


@pytest.mark.parametrize("package", DOORS)
def test_every_door_is_used(package: str) -> None:
    users = [name for name in HOST_FILES if package in packages(PACKAGES["gellight"] / name)]
    assert [door for door in DOORS[package] if not any(name.startswith(door) for name in users)] == []


def test_every_file_of_the_host_is_in_a_room() -> None:
    assert {name.split("/")[0].removesuffix(".py") for name in HOST_FILES} == {*ROOMS, "__init__"}


@pytest.mark.parametrize("module", [module for module in HOST if module != "gellight"])
def test_a_room_imports_only_from_rooms_below_it(module: str) -> None:
    above = {other for other in HOST[module] if ROOMS.index(room(other)) > ROOMS.index(room(module))}
    assert {other for other in above if (module, other) not in EXCEPTIONS} == set()


def test_every_exception_is_needed() -> None:
    assert [pair for pair in EXCEPTIONS if pair[1] not in HOST[pair[0]]] == []


@pytest.mark.parametrize("package", PACKAGES)
def test_no_imports_go_round_in_a_circle(package: str) -> None:
    try:
        TopologicalSorter(graph(package)).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_imports_by_a_computed_name_are_known() -> None:
    assert {name for name in HOST_FILES if "?" in imports(PACKAGES["gellight"] / name)} == set(OPEN_CALLS)


def test_imports_are_absolute() -> None:
    assert [name for name in HOST_FILES if any(i.startswith(".") for i in imports(PACKAGES["gellight"] / name))] == []


PLANTED = """
from typing import TYPE_CHECKING
if TYPE_CHECKING:
    from gellight.cli.main import app
def f():
    import gellight.daemon.daemon
    from gellight.sensor import udev
    importlib.import_module("gellight.opening")
    import_module(name)
"""


def test_an_import_is_seen_wherever_it_stands() -> None:
    assert set(imported(ast.parse(PLANTED))) == {
        "typing.TYPE_CHECKING", "gellight.cli.main.app", "gellight.daemon.daemon", "gellight.sensor.udev",
        "gellight.opening", "?",
    }  # fmt: skip


TESTS = ROOT / "tests"


def test_the_tests_of_the_host_lie_in_folders_named_as_its_rooms() -> None:
    folders = {path.relative_to(TESTS / "host").parts[0] for path in (TESTS / "host").glob("*/**/*.py")}
    assert folders <= set(ROOMS)
    assert [path.name for path in (TESTS / "host").glob("*.py") if path.name != "conftest.py"] == []


def test_no_test_imports_another_test_file() -> None:
    for path in TESTS.rglob("*.py"):
        shared = {name for name in imports(path) if name.startswith("tests.")}
        assert not [name for name in shared if any(part.startswith("test_") for part in name.split(".")[:-1])], path
        assert not [name for name in shared if "conftest" in name.split(".")], path


def test_helpers_lie_apart_from_the_tests() -> None:
    apart = {"helpers", "benchmarks", "inside", "machine"}
    beside = [path for path in TESTS.glob("*/**/*.py") if not apart & set(path.relative_to(TESTS).parts)]
    assert [path for path in beside if not path.name.startswith("test_") and path.name != "conftest.py"] == []
