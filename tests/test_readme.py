"""The package as README.md uses it: its program runs, and importing it is light."""

import inspect
import pydoc
import re
import sys
import textwrap

import pytest

import gellight
from tests.helpers.children import run
from tests.helpers.doc_examples import examples


@pytest.mark.parametrize("block", examples("README.md"))
def test_the_program_in_the_readme_runs(block: str) -> None:
    done = run([sys.executable, "-c", block])
    assert done.returncode == 0, done.stderr
    assert re.search(r"(0\.9\d|1\.0\d) mm deep", done.stdout), done.stdout
    assert "(480, 640) (480, 640, 3)" in done.stdout


@pytest.mark.parametrize(
    ("imported", "heavy"),
    [
        ("gellight", ("numpy", "cv2", "onnxruntime", "aiohttp", "zenoh", "mcap")),
        ("gellight.stream.subscription", ("onnxruntime", "aiohttp", "mcap", "serial", "gellight.daemon.session")),
        ("gellight.stream.sensor", ("scipy.ndimage", "scipy.sparse", "scipy.optimize", "asyncio", "aiohttp", "zenoh")),
        ("gellight.cli.one_sensor", ("scipy.ndimage", "scipy.sparse", "scipy.optimize", "aiohttp", "gellight.lab")),
    ],
)
def test_importing_the_package_or_what_a_program_needs_imports_nothing_heavy_that_it_does_not(
    imported: str, heavy: tuple[str, ...]
) -> None:
    code = f"import sys, {imported}; print([name for name in {heavy} if name in sys.modules])"
    assert run([sys.executable, "-c", code], check=True).stdout.strip() == "[]"


def test_help_begins_with_what_a_program_needs_first() -> None:
    """pydoc prints the docstring first: `connect` and `subscribe` with their arguments, and a program that runs."""
    shown = pydoc.render_doc(gellight, renderer=pydoc.plaintext)
    assert shown.index("gellight.connect(") < shown.index("connect(url=") < shown.index("class Bundle")
    assert len(shown[: shown.index("PACKAGE CONTENTS")].splitlines()) < 30
    assert "numpy.ndarray[" not in shown, "types by their short names"
    for name in ("connect", "subscribe"):
        (told,) = re.findall(rf"^ *{name}\((.*), \.\.\.\) -> \w+$", shown, re.MULTILINE)
        assert {*re.findall(r"(\w+)=", told)} < {*inspect.signature(getattr(gellight, name)).parameters}


def test_the_first_program_of_help_runs() -> None:
    program = (gellight.__doc__ or "").partition("    import gellight")[2].partition("    with gellight.subscribe")[0]
    code = "import gellight" + textwrap.dedent(program)
    assert re.match(r"(0\.9|1\.0)\d* mm deep \(480, 640\)", run([sys.executable, "-c", code], check=True).stdout)
