"""The package as README.md uses it: its program runs, and importing it is light."""

import re
import sys

import pytest

from tests.helpers.children import run
from tests.helpers.doc_examples import examples


@pytest.mark.parametrize("block", examples("README.md"))
def test_the_program_in_the_readme_runs(block: str) -> None:
    done = run([sys.executable, "-c", block])
    assert done.returncode == 0, done.stderr
    assert re.search(r"(0\.9\d|1\.0\d) mm deep", done.stdout), done.stdout
    assert "(480, 640) (480, 640, 3)" in done.stdout


def test_importing_the_package_imports_nothing_heavy() -> None:
    heavy = ("numpy", "cv2", "onnxruntime", "aiohttp", "zenoh", "mcap")
    code = f"import sys, gellight; print([name for name in {heavy} if name in sys.modules])"
    assert run([sys.executable, "-c", code], check=True).stdout.strip() == "[]"
