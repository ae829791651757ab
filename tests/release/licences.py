"""What comes with `pip install gellight`, and under which licences: packages, and the libraries inside their wheels."""

import functools
import importlib.metadata
import re
import tomllib
from collections.abc import Iterable, Mapping

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.helpers.places import CHECKOUT

PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
FOR_DEVELOPERS = {"dev", "docs", "fuzz", "test"}
"""extras that no user needs"""
ALLOWED = {
    "0BSD", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "BSD", "BSD-2-Clause", "BSD-3-Clause", "BSL-1.0", "CC0-1.0",
    "ISC", "MIT", "OpenSSL", "PSF-2.0", "Public domain", "Zlib", "libpng-2.0",
}  # fmt: skip
OTHERWISE_CALLED = {
    "3-Clause BSD License": "BSD-3-Clause", "Apache 2.0": "Apache-2.0", "Apache Software License": "Apache-2.0",
    "BSD License": "BSD", "ISC License (ISCL)": "ISC", "MIT License": "MIT", "Public Domain": "Public domain",
    "Python Software Foundation License": "PSF-2.0",
}  # fmt: skip
NOT_IN_METADATA = {
    "eclipse-zenoh": "EPL-2.0 OR Apache-2.0",
    "colorama": "BSD-3-Clause",  # for Windows alone, so not here to be asked
}
LGPL, GCC = "LGPL-2.1-or-later", "GPL-3.0-or-later WITH GCC-exception-3.1"
REASONS = {
    LGPL: "a library of its own, unchanged, that its user may replace",
    GCC: "the exception lets a program of any licence use what GCC adds to it",
}
"""licences beside `ALLOWED` that a library inside a wheel may have, and why"""
INSIDE = {
    "aom": "BSD-2-Clause", "av(codec|format|util)": LGPL, "avif": "BSD-2-Clause", "sw(resample|scale)": LGPL,
    "crypto|ssl": "OpenSSL", "drm": "MIT", "gfortran": GCC, "quadmath": LGPL, "onnxruntime": "MIT",
    "onnxruntime_providers_shared": "MIT", r"openblasp-r\d+|scipy_openblas(64_)?": "BSD-3-Clause",
    "png16": "libpng-2.0", "vpx": "BSD-3-Clause",
}  # fmt: skip
"""libraries inside the wheels, by their name without `lib`"""


def closure(needs: Iterable[str]) -> dict[str, importlib.metadata.Distribution]:
    """Return, by name, what these requirements bring on this system, as it is installed here."""
    found: dict[str, importlib.metadata.Distribution] = {}
    known, left = set(), [Requirement(need) for need in needs]
    while left:
        need = left.pop()
        name = canonicalize_name(need.name)
        if (name, *sorted(need.extras)) in known:
            continue
        known.add((name, *sorted(need.extras)))
        found[name] = importlib.metadata.distribution(name)
        for other in map(Requirement, found[name].requires or ()):
            if not other.marker or any(other.marker.evaluate({"extra": extra}) for extra in ("", *need.extras)):
                left.append(other)
    return found


@functools.cache
def shipped() -> dict[str, importlib.metadata.Distribution]:
    return closure(PROJECT["dependencies"])


def of_extras() -> dict[str, importlib.metadata.Distribution]:
    """Return what users' extras bring beyond that, as far as they can be installed here."""
    extras: Mapping[str, list[str]] = PROJECT["optional-dependencies"]
    needs = [need for extra, needs in extras.items() if extra not in FOR_DEVELOPERS for need in needs]
    return {name: found for name, found in closure(needs).items() if name not in shipped()}


def licence(distribution: importlib.metadata.Distribution) -> str:
    """Return the licence that a package names, as an SPDX expression where it can be told; "" where it names none."""
    told = distribution.metadata.json
    name = canonicalize_name(str(told["name"]))
    classifiers = [text.split(" :: ")[-1] for text in told.get("classifier", ()) if text.startswith("License :: ")]
    texts = classifiers or [str(told.get("license", ""))]
    by_word = told.get("license_expression") or " AND ".join(OTHERWISE_CALLED.get(text, text) for text in texts)
    return NOT_IN_METADATA.get(name) or str(by_word)


def allowed(expression: str) -> bool:
    """Return whether one may choose licences of `ALLOWED` throughout."""
    parts = expression.split(" AND ")
    return all(any(choice in ALLOWED for choice in part.strip("()").split(" OR ")) for part in parts)


def libraries(distribution: importlib.metadata.Distribution) -> dict[str, str]:
    """Return the shared libraries inside a wheel that are no modules of Python, with their licences; "": unknown."""
    files = {file.name for file in distribution.files or () if ".so" in file.name and file.parts[0] != ".."}
    names = {re.sub(r"(-[0-9a-f]{8})*(\.\d+)*\.so.*|^lib", "", name) for name in files if name.startswith("lib")}
    return {name: next((to for what, to in INSIDE.items() if re.fullmatch(what, name)), "") for name in sorted(names)}
