"""A store and a cache of the test's own."""

from tests.helpers.studies import options, own_cache

__all__ = ["options", "own_cache"]
