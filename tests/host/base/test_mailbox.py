"""What threads hand each other: the mailbox keeps the latest, and the next item is computed while one is used."""

import threading
import weakref
from collections.abc import Iterator

import pytest

from gellight.base.mailbox import Mailbox
from gellight.base.one_ahead import one_ahead


def test_only_the_newest_item_is_kept_and_it_is_taken_once() -> None:
    mailbox: Mailbox[str] = Mailbox()
    mailbox.put("old")
    mailbox.put("new")
    assert mailbox.take(0, timeout_s=0) == (2, "new")
    with pytest.raises(TimeoutError):
        mailbox.take(2, timeout_s=0.01)


def test_several_items_are_taken_in_order_and_let_go_of() -> None:
    mailbox: Mailbox[set[int]] = Mailbox(3)
    for number in range(5):
        mailbox.put({number})
    number, item = mailbox.take(0, timeout_s=0)
    assert (number, item) == (3, {2}), "the oldest that is still there"
    taken = weakref.ref(item)
    del item
    assert mailbox.take(number, timeout_s=0) == (4, {3})
    assert taken() is None


def test_a_waiting_reader_is_woken_by_the_next_item() -> None:
    mailbox: Mailbox[int] = Mailbox()
    taken: list[tuple[int, int]] = []
    reader = threading.Thread(target=lambda: taken.append(mailbox.take(0, timeout_s=10)))
    reader.start()
    mailbox.put(7)
    reader.join(timeout=10)
    assert taken == [(1, 7)]


def test_after_closing_the_last_item_is_still_there_and_then_the_first_reason() -> None:
    mailbox: Mailbox[str] = Mailbox()
    mailbox.put("last")
    mailbox.close(ValueError("used up"))
    mailbox.close(ValueError("second"))
    number, item = mailbox.take(0, timeout_s=0)
    assert item == "last"
    with pytest.raises(ValueError, match="used up"):
        mailbox.take(number, timeout_s=10)


def test_what_was_thrown_away_is_not_taken_but_by_a_copy_that_keeps_it_and_numbers_go_on() -> None:
    mailbox: Mailbox[str] = Mailbox()
    with mailbox.subscribe(4) as passing, mailbox.subscribe(4, lasting=True) as lasting:
        mailbox.put("old")
        mailbox.clear()
        with pytest.raises(TimeoutError):
            mailbox.take(0, 0.01)
        mailbox.put("new")
        assert mailbox.take(0, 1) == passing.take(0, 1) == (2, "new")
        assert [lasting.take(after, 1) for after in (0, 1)] == [(1, "old"), (2, "new")]


# ---- one ahead ----


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
