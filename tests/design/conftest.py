"""A cache of the test's own."""

from tests.helpers.studies import own_cache

__all__ = ["own_cache"]
