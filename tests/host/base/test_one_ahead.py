"""The next item of an iterator is computed while the caller works on this one."""

import threading
from collections.abc import Iterator

import pytest

from gellight.base.one_ahead import one_ahead


def test_items_come_in_their_order() -> None:
    assert list(one_ahead(range(5))) == [0, 1, 2, 3, 4]
    assert list(one_ahead([])) == []


def test_the_next_item_is_computed_meanwhile_and_only_that() -> None:
    computed = [threading.Event() for _ in range(3)]

    def items() -> Iterator[int]:
        for number, done in enumerate(computed):
            done.set()
            yield number

    coming = one_ahead(items())
    assert next(coming) == 0
    assert computed[1].wait(60)
    assert not computed[2].is_set()


def test_a_failure_is_raised_after_the_items_before_it() -> None:
    def items() -> Iterator[int]:
        yield 0
        raise ValueError("second")

    seen = []
    with pytest.raises(ValueError, match="second"):
        seen.extend(one_ahead(items()))
    assert seen == [0]


def test_who_wants_no_more_tells_the_thread() -> None:
    given_up = threading.Event()

    def items() -> Iterator[int]:
        yield 0
        assert given_up.wait(60)
        yield 1

    for _ in one_ahead(items(), given_up.set):
        break
    assert given_up.is_set()
