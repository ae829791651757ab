"""What the README promises runs."""

import re
import sys
from pathlib import Path

import pytest

import gellight
from tests.helpers.children import run

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()


@pytest.mark.parametrize("block", re.findall(r"```python\n(.*?)```", README, re.DOTALL))
def test_the_program_in_the_readme_runs(block: str) -> None:
    done = run([sys.executable, "-c", block])
    assert done.returncode == 0, done.stderr
    assert re.search(r"(0\.9\d|1\.0\d) mm deep", done.stdout), done.stdout
    assert "(480, 640) (480, 640, 3)" in done.stdout


def test_every_file_the_documents_link_to_is_there() -> None:
    for document in (ROOT / "README.md", *ROOT.glob("docs/*.md"), ROOT / "models/README.md"):
        for link in re.findall(r"\]\((?!https?:)([^)#]+)", document.read_text()):
            assert (document.parent / link).exists(), f"{document.name} links to {link}"


def test_every_verb_in_the_readme_exists() -> None:
    from typer.main import get_command

    from gellight.cli.main import app

    verbs = set(get_command(app).commands)  # type: ignore[attr-defined]
    assert set(re.findall(r"`gellight ([\w-]+)", README)) <= verbs


@pytest.mark.parametrize("name", gellight.__all__)
def test_every_public_name_can_be_had(name: str) -> None:
    assert getattr(gellight, name).__doc__


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = "import sys, gellight; print([m for m in ('numpy', 'cv2', 'onnxruntime', 'aiohttp') if m in sys.modules])"
    assert run([sys.executable, "-c", code], check=True).stdout.strip() == "[]"
