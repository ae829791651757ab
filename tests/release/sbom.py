"""Write what is in a release, as CycloneDX: `python -m tests.release.sbom FILE`.

Versions and hashes are those of host/requirements.txt, licences those that the installed packages name. Libraries
inside a wheel are listed as parts of its package.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from tests.helpers.places import CHECKOUT
from tests.release.licences import NOT_IN_METADATA, libraries, licence, shipped

PINNED = CHECKOUT / "host/requirements.txt"
MAKE = (sys.executable, "-m", "cyclonedx_py", "requirements", PINNED, "--pyproject", CHECKOUT / "pyproject.toml")


def sbom() -> dict[str, Any]:
    done = subprocess.run([*MAKE, "--output-reproducible"], check=True, capture_output=True, text=True)
    bill: dict[str, Any] = json.loads(done.stdout)
    for component in bill["components"]:
        del component["description"]  # the lines of the file, with every hash again
        distribution = shipped().get(component["name"])
        told = licence(distribution) if distribution else NOT_IN_METADATA[component["name"]]
        component["licenses"] = _as_licences(told)
        inside = libraries(distribution) if distribution else {}
        if inside:
            component["components"] = [
                {"type": "library", "name": f"lib{name}", "licenses": _as_licences(of)} for name, of in inside.items()
            ]
    return bill


def _as_licences(told: str) -> list[dict[str, Any]]:
    """Return a licence as CycloneDX writes it; BSD and public domain are no SPDX names."""
    return [{"license": {"name": told}}] if told in ("BSD", "Public domain") else [{"expression": told}]


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(json.dumps(sbom(), indent=1) + "\n")
