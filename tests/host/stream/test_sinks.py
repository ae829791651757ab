"""A camera and a sink of another distribution, as docs/extending.md has them, and what is refused."""

import os
import shutil
import sys
import tomllib
from pathlib import Path

import pytest

from gellight.base.errors import CameraError, StreamError
from gellight.opening import open_camera
from gellight.stream.frame_thread import sent_to
from tests.helpers.children import gellight, run
from tests.helpers.doc_examples import examples
from tests.helpers.places import CHECKOUT

EXAMPLE = CHECKOUT / "docs/examples/extending"


def planted(folder: Path) -> Path:
    """Put the example where an installer would: its file, and what its project says of entry points."""
    shutil.copy(EXAMPLE / "my_gellight.py", folder)
    points = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]["entry-points"]
    told = folder / "my_gellight-0.1.0.dist-info"
    told.mkdir()
    (told / "METADATA").write_text("Metadata-Version: 2.1\nName: my_gellight\nVersion: 0.1.0\n")
    lines = [
        f"[{group}]\n" + "\n".join(f"{name} = {place}" for name, place in those.items())
        for group, those in points.items()
    ]
    (told / "entry_points.txt").write_text("\n\n".join(lines))
    return folder


def runs(tmp_path: Path, place: Path) -> None:
    path = os.pathsep.join([str(place), os.environ.get("PYTHONPATH", "")])
    told = ["--sensor", "grey://127", "--name", "mine", "--frames", "20"]
    told += ["--set", "stream.sinks=forces", "--set", "stream.enabled=false"]
    done = gellight("run", *told, cwd=tmp_path, env={**os.environ, "PYTHONPATH": path})
    assert done.returncode == 0, done.stderr
    lines = (tmp_path / "mine.csv").read_text().splitlines()
    numbers = [int(line.split(",")[0]) for line in lines]
    assert len(numbers) > 5
    assert numbers == sorted(set(numbers))


def test_a_camera_and_a_sink_from_elsewhere_run(tmp_path: Path) -> None:
    place = tmp_path / "site"
    place.mkdir()
    runs(tmp_path, planted(place))


@pytest.mark.nightly
def test_they_are_installed_from_a_folder_outside(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLE, tmp_path / "mine")
    how = ["--quiet", "--no-deps", "--no-build-isolation", "--target", tmp_path / "site"]
    run([sys.executable, "-m", "pip", "install", *how, tmp_path / "mine"], check=True)
    runs(tmp_path, tmp_path / "site")


def test_the_document_shows_the_example() -> None:
    code = (EXAMPLE / "my_gellight.py").read_text()
    shown = [line for block in examples("docs/extending.md") for line in block.splitlines()]
    assert len(shown) > 15
    assert [line for line in shown if line not in code] == []


def test_what_nobody_has_is_refused_with_what_there_is() -> None:
    with pytest.raises(CameraError, match="no camera speaks grey://"):
        open_camera("grey://1")
    with pytest.raises(StreamError, match=r"has a sink 'forces' \(none is installed\)"), sent_to("forces", None, "x"):  # type: ignore[arg-type]
        pass
