"""Who may import whom: the rooms of the house and the doors between them."""

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = {
    "gellight": ROOT / "host/gellight",
    "gelnet": ROOT / "models/gelnet",
    "sim_reference": ROOT / "sim_reference",
}
FORBIDDEN_HOST = {"torch", "gelnet", "onnx"}
# Files, or folders of which every file is one.
HOST_DOORS = {
    "sim_reference": {
        *("scene.py", "simulated.py", "selfcheck.py", "synthetic.py"),
        "optimize",
        "optimize.py",
        "simulated_presses.py",
    },
    "cv2": {
        "camera.py",
        "presses.py",
        "pictures.py",
        "calibration.py",
        "server.py",
        "messages.py",
        "decoding.py",
        "jpeg.py",
        "encoding.py",
        "opencv_camera.py",
        "pins.py",
        "undistortion.py",
        "reconstruction.py",
        "smoothing.py",
    },
    "onnxruntime": {"gelnet.py", "bench.py"},
}


def modules(room: str) -> list[Path]:
    return sorted(ROOMS[room].rglob("*.py"))


def imports(path: Path, *, top_level_only: bool = False) -> set[str]:
    tree = ast.parse(path.read_text())
    nodes = tree.body if top_level_only else list(ast.walk(tree))
    found: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found.add(node.module.split(".")[0])
    return found


@pytest.mark.parametrize("path", modules("sim_reference"), ids=lambda p: p.name)
def test_the_reference_imports_only_numpy_and_scipy(path: Path) -> None:
    assert imports(path) <= {"numpy", "scipy", "sim_reference"} | sys.stdlib_module_names


@pytest.mark.parametrize("path", modules("gellight"), ids=lambda p: str(p.relative_to(ROOMS["gellight"])))
def test_the_host_never_imports_training(path: Path) -> None:
    assert not imports(path) & FORBIDDEN_HOST
    for package, doors in HOST_DOORS.items():
        assert package not in imports(path) or {path.name, path.parent.name} & doors, (
            f"{package} may only be imported in {doors}"
        )


@pytest.mark.parametrize("path", modules("gelnet"), ids=lambda p: p.name)
def test_training_never_imports_the_host(path: Path) -> None:
    assert "gellight" not in imports(path)


@pytest.mark.parametrize("path", sorted((ROOMS["gellight"] / "cli").glob("*.py")), ids=lambda p: p.name)
def test_the_command_line_imports_nothing_heavy_at_the_top(path: Path) -> None:
    heavy = {"cv2", "numpy", "scipy", "onnxruntime", "aiohttp", "sim_reference"}
    assert not imports(path, top_level_only=True) & heavy


def test_a_forbidden_import_would_be_seen(tmp_path: Path) -> None:
    planted = tmp_path / "planted.py"
    planted.write_text("def f():\n    import gellight.ring\n")
    assert imports(planted) == {"gellight"}
    assert imports(planted, top_level_only=True) == set()
