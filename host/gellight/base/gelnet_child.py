"""Where a child process finds `gelnet`, which the host never imports."""

import importlib.util
import os
from pathlib import Path

from gellight.base.errors import TrainingError

_BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""read by NumPy's matrix library when it is loaded; each build of NumPy heeds one of them"""


def gelnet_environment(threads: int) -> dict[str, str]:
    """Return the environment in which the child finds the host's `gelnet` and computes with `threads` threads."""
    spec = importlib.util.find_spec("gelnet")
    if spec is None or not spec.submodule_search_locations:
        raise TrainingError("the package gelnet is not installed beside gellight: reinstall gellight")
    places = [str(Path(next(iter(spec.submodule_search_locations))).parent), os.environ.get("PYTHONPATH", "")]
    path = {"PYTHONPATH": os.pathsep.join(place for place in places if place)}
    return {**os.environ, **dict.fromkeys(_BLAS_THREADS, str(threads)), **path}
