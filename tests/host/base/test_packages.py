"""A package that is missing is told from one that does not load."""

import pytest

from gellight.base.errors import InputError, needed


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ModuleNotFoundError("No module named 'h5py'"), "pip install this"),
        (ImportError("lib.so: failed to map segment"), "cannot be loaded: lib.so: failed to map segment"),
    ],
)
def test_only_a_missing_package_is_to_be_installed(error: ImportError, told: str) -> None:
    with pytest.raises(InputError, match=told), needed("pip install this"):
        raise error
