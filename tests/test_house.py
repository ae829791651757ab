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
RUN = (
    "base", "ring", "bundle", "frames", "photometric", "reconstruction", "reconstruction.native", "frame_path",
    "tracking", "series", "sensor", "recording", "watch", "opening", "daemon", "stream", "dashboard",
)  # fmt: skip
"""the half that a robot needs, lowest first: a room imports from itself and from rooms before it"""
LAB = tuple(
    f"lab.{name}"
    for name in (
        "report", "doctor", "emulator", "simulator", "touch", "training", "optics", "design", "boards", "housing",
        "calibration", "scanning",
    )
)  # fmt: skip
"""the half that makes, calibrates, simulates and designs: it uses the running half up to `opening`"""
ABOVE = ("cli",)
"""what stands above both halves"""
ROOMS = (*RUN[: RUN.index("opening") + 1], *LAB, *RUN[RUN.index("opening") + 1 :], *ABOVE)
LAB_DOORS = {
    "opening.py": "sim:// cameras",
    "ring/transport.py": "sim:// boards",
    "daemon/calibration_service.py": "the calibration beside the stream",
    "daemon/needs.py": "what that calibration needs",
}
"""the only files of the running half that import from the lab, and for what"""
TORCH_FILES = {"batches.py", "network.py", "torch_trainer.py"}
"""of gelnet: everything else there works without torch"""
FORBIDDEN_HOST = {"torch", "gelnet"}
DOORS = {
    "sim_reference": (
        "lab/simulator/batches.py", "lab/simulator/gel_models.py", "lab/simulator/known_force.py",
        "lab/simulator/memory.py",
        "lab/simulator/one_drag.py", "lab/simulator/one_press.py", "lab/simulator/read_noise.py",
        "lab/simulator/scene.py",
        "lab/simulator/selfcheck.py", "lab/simulator/selfcheck_bounds.py", "lab/simulator/sequence.py",
        "lab/simulator/simulated_camera.py", "lab/simulator/simulated_url.py", "lab/simulator/unit.py",
        "lab/simulator/stage.py", "lab/simulator/dataset.py", "lab/simulator/demo_presses.py",
        "lab/simulator/dragging.py", "lab/simulator/printed_dots.py", "lab/touch/", "lab/training/synthetic.py",
        "lab/boards/", "lab/design/", "lab/housing/", "cli/optimize.py", "cli/simulate.py", "cli/sweeping.py",
    ),
    "cv2": (
        "bundle/contents.py", "lab/optics/lens/pins.py", "dashboard/view.py",
        "frames/dots.py", "frames/dot_places.py",
        "frames/image_files.py", "frames/pixel_grid.py", "frames/video_files.py", "frames/view.py",
        "reconstruction/at_rest.py", "reconstruction/integration.py", "reconstruction/lens/undistortion.py",
        "reconstruction/linearised.py", "reconstruction/smoothing.py", "tracking/starts.py", "tracking/view.py",
        "series/reconstructor.py", "lab/report/pictures.py", "lab/report/video.py",
        "sensor/opencv_camera.py", "sensor/v4l2/decoding.py", "lab/simulator/usb/encoding.py",
        "lab/training/labelling/plate.py", "lab/touch/shade.py", "lab/touch/environments/observing.py",
        "recording/frame_record.py",
    ),
    "onnxruntime": ("reconstruction/network_session.py",),
    "serial": ("ring/transport.py", "ring/firmware/flash.py"),
    "usb": ("ring/transport.py", "ring/firmware/flash.py"),
    "aiohttp": ("dashboard/",),
    "zenoh": ("stream/",),
    "foxglove": ("stream/foxglove.py",),
    "pyarrow": ("recording/lerobot_files.py",),
    "mcap": ("recording/recording_file.py",),
    "typer": ("cli/",),
    "rich": ("cli/",),
    "ezdxf": ("lab/design/",),
    "shapely": ("lab/boards/pour.py",),
    "mcubes": ("lab/scanning/body.py",),
    "x3pio": ("lab/scanning/map_files.py",),
    "OCP": ("lab/housing/solids.py",),
    "rp2040py": ("lab/emulator/",),
    "mujoco": ("lab/touch/",),
    "gymnasium": ("lab/touch/environments/",),
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
    names = module.split(".")[1:]
    inner = names[0] == "lab" or ".".join(names[:2]) in RUN
    return ".".join(names[:2]) if inner else names[0]


HOST = graph("gellight")
HOST_FILES = [path.relative_to(PACKAGES["gellight"]).as_posix() for path in modules("gellight").values()]


@pytest.mark.parametrize("path", modules("sim_reference").values(), ids=lambda p: p.name)
def test_the_reference_imports_only_numpy_and_scipy(path: Path) -> None:
    assert packages(path) <= {"numpy", "scipy", "sim_reference"} | sys.stdlib_module_names


@pytest.mark.parametrize("path", modules("gelnet").values(), ids=lambda p: p.name)
def test_training_never_imports_the_host(path: Path) -> None:
    assert "gellight" not in packages(path)


def test_torch_is_imported_only_where_it_is_asked_for() -> None:
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
    assert {room(module) for module in HOST if module not in ("gellight", "gellight.lab")} == set(ROOMS)


MODULES = [module for module in HOST if module not in ("gellight", "gellight.lab")]


@pytest.mark.parametrize("module", MODULES)
def test_a_room_imports_only_from_rooms_below_it(module: str) -> None:
    order = RUN if room(module) in RUN else ROOMS
    others = {other for other in HOST[module] if room(other) in order}
    assert {other for other in others if order.index(room(other)) > order.index(room(module))} == set()


def test_the_running_half_enters_the_lab_by_its_doors_alone() -> None:
    inside = [module for module in MODULES if room(module) in RUN]
    entering = {module for module in inside if any(room(other) in LAB for other in HOST[module])}
    assert {module.removeprefix("gellight.").replace(".", "/") + ".py" for module in entering} == set(LAB_DOORS)


def test_a_reader_of_the_running_half_meets_at_most_ten_floors() -> None:
    rooms = {name: {room(o) for m in MODULES if room(m) == name for o in HOST[m]} & set(RUN) - {name} for name in RUN}

    @functools.cache
    def floor(name: str) -> int:
        return 1 + max((floor(other) for other in rooms[name]), default=0)

    assert max(map(floor, RUN)) <= 10, {name: floor(name) for name in RUN}


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
    import gellight.daemon.session
    from gellight.sensor import udev
    importlib.import_module("gellight.opening")
    import_module(name)
"""


def test_an_import_is_seen_wherever_it_stands() -> None:
    assert set(imported(ast.parse(PLANTED))) == {
        "typing.TYPE_CHECKING", "gellight.cli.main.app", "gellight.daemon.session", "gellight.sensor.udev",
        "gellight.opening", "?",
    }  # fmt: skip


TESTS = ROOT / "tests"


def test_the_tests_of_the_host_lie_in_folders_named_as_its_rooms() -> None:
    tests = (path.relative_to(TESTS / "host") for path in (TESTS / "host").glob("*/**/*.py"))
    assert {room(".".join(("tests", *path.parts))) for path in tests} <= set(ROOMS)
    assert [path.name for path in (TESTS / "host").glob("*.py") if path.name != "conftest.py"] == []


def test_no_test_imports_another_test_file() -> None:
    for path in TESTS.rglob("*.py"):
        shared = {name for name in imports(path) if name.startswith("tests.")}
        assert not [name for name in shared if any(part.startswith("test_") for part in name.split(".")[:-1])], path
        assert not [name for name in shared if "conftest" in name.split(".")], path


def test_helpers_lie_apart_from_the_tests() -> None:
    apart = {"helpers", "benchmarks", "paper", "soak", "inside", "machine", "data", "release", "fuzz"}
    beside = [path for path in TESTS.glob("*/**/*.py") if not apart & set(path.relative_to(TESTS).parts)]
    assert [path for path in beside if not path.name.startswith("test_") and path.name != "conftest.py"] == []
