"""The clock map: its bounds contain the truth under any jitter, and are as narrow as the best pings allow."""

import numpy as np
import pytest

from gellight.ring.light_ring import Ping
from gellight.sensor.lighting.clock import ClockMap
from tests.helpers.clock_bounds import board_us


class TrueClock:
    """A board whose clock is known: offset, drift, and a drift that wanders slowly."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.offset_us = rng.uniform(-1e9, 1e9)
        self.drift = rng.uniform(-1.4e-4, 1.4e-4)
        self.wander = rng.uniform(-1, 1) * 1e-6
        self.period_s = rng.uniform(20, 100)

    def board_us(self, host_s: float) -> float:
        turn = 2 * np.pi / self.period_s
        return host_s * 1e6 * (1 + self.drift) + self.offset_us + 1e6 * self.wander / turn * np.sin(turn * host_s)


def ping(clock: TrueClock, host_s: float, there_s: float, think_s: float, back_s: float) -> Ping:
    received_s = host_s + there_s
    return Ping(
        host_sent_s=host_s,
        board_received_us=int(np.floor(clock.board_us(received_s))),
        board_sent_us=int(np.floor(clock.board_us(received_s + think_s))),
        host_received_s=received_s + think_s + back_s,
    )


def jittered(clock: TrueClock, host_s: float, rng: np.random.Generator) -> Ping:
    """0.2 ms each way, plus delays that are long, rare and mostly on the way back."""
    there, back = 2e-4 + rng.exponential(3e-4), 2e-4 + rng.exponential(2e-3) + 0.03 * (rng.random() < 0.1)
    return ping(clock, host_s, there, rng.uniform(0, 1e-4), back)


@pytest.mark.parametrize("seed", range(40))
def test_the_truth_is_within_the_bounds_whatever_the_jitter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    clock, known, now_s = TrueClock(rng), ClockMap(), rng.uniform(0, 1e5)
    for _ in range(100):
        now_s += rng.exponential(0.3)
        known.add(jittered(clock, now_s, rng))
        asked_s = now_s + rng.uniform(-3.0, 3.0)
        low, high = board_us(known, asked_s)
        assert low - 1 <= clock.board_us(asked_s) <= high + 1
        low_s, high_s = known.host_s(clock.board_us(asked_s))
        assert low_s - 1e-6 <= asked_s <= high_s + 1e-6
        now_drift = clock.drift + clock.wander * np.cos(2 * np.pi / clock.period_s * now_s)
        assert known.drift.low <= now_drift <= known.drift.high
    assert known.jumps == 0


def test_short_round_trips_make_narrow_bounds_and_long_ones_do_no_harm() -> None:
    rng = np.random.default_rng(1)
    clock, known, all_bounds = TrueClock(rng), ClockMap(), []
    for number in range(120):
        now_s = 100 + 0.25 * number
        known.add(jittered(clock, now_s, rng))
        all_bounds.append(board_us(known, now_s).error)
    assert np.median(all_bounds[40:]) < 500, "the ways take 0.4 ms at least: half of that is what symmetry would give"
    before = board_us(known, now_s).error
    known.add(ping(clock, now_s + 0.1, 0.4, 0.0, 0.4))
    assert board_us(known, now_s).error <= before + 0.2


def test_the_bounds_grow_with_the_time_since_the_last_ping_and_before_the_first_nothing_is_known() -> None:
    rng = np.random.default_rng(2)
    clock, known = TrueClock(rng), ClockMap()
    known.add(jittered(clock, 50.0, rng))
    errors = [board_us(known, 50.0 + later).error for later in (0, 1, 10, 100)]
    assert errors == sorted(errors)
    assert errors[-1] - errors[0] == pytest.approx(20_000, rel=0.02), "200 us a second"
    known = ClockMap()
    assert not known.covers(0.0, 1.0)
    with pytest.raises(ValueError, match="before the first ping"):
        known.host_s(1.0)


def test_a_board_that_starts_anew_is_noticed_and_nothing_before_is_claimed() -> None:
    rng = np.random.default_rng(4)
    clock, known = TrueClock(rng), ClockMap()
    for number in range(8):
        known.add(jittered(clock, 10 + number, rng))
    assert known.covers(10.5, 16.5)
    clock.offset_us -= 100_000
    known.add(jittered(clock, 18.0, rng))
    assert known.jumps == 1
    assert not known.covers(16.5, 17.5)
    known.add(jittered(clock, 19.0, rng))
    assert known.covers(18.5, 18.9)
    assert not known.covers(18.5, 19.5)


def test_a_clock_that_runs_by_fits_and_starts_widens_the_bounds_instead_of_lying() -> None:
    rng = np.random.default_rng(5)
    clock, known, now_s = TrueClock(rng), ClockMap(), 10.0
    for _ in range(200):
        now_s += 0.1
        behind_us = rng.uniform(0, 3000)
        steady = ping(clock, now_s, 1e-4, 0.0, 1e-4)
        known.add(
            Ping(
                host_sent_s=steady.host_sent_s,
                board_received_us=round(steady.board_received_us - behind_us),
                board_sent_us=round(steady.board_sent_us - behind_us),
                host_received_s=steady.host_received_s,
            )
        )
    assert known.jumps == 0
    assert known.noise_us > 1000
    low, high = board_us(known, now_s)
    assert low <= clock.board_us(now_s) - 3000
    assert clock.board_us(now_s) <= high


def stalled(rng: np.random.Generator, stall_us: float) -> tuple[TrueClock, ClockMap]:
    """Eight quick pings, then the clock stands still, then a slow ping and two quick ones."""
    clock, known = TrueClock(rng), ClockMap()
    for number in range(8):
        known.add(ping(clock, 10 + number, 2e-4, 0.0, 2e-4))
    clock.offset_us -= stall_us
    known.add(ping(clock, 18.0, 0.03, 0.0, 1e-3))
    return clock, known


def test_a_slow_ping_does_not_vouch_for_a_clock() -> None:
    _, known = stalled(np.random.default_rng(6), 28_000.0)
    assert known.jumps == 0, "its bounds are too wide to show the jump"
    assert not known.covers(16.5, 17.5)
    assert known.covers(15.5, 16.9)


@pytest.mark.parametrize("stall_us", [1500.0, 4000.0, 28_000.0])
def test_a_clock_that_stood_still_is_believed_only_near_its_pings(stall_us: float) -> None:
    clock, known = stalled(np.random.default_rng(7), stall_us)
    for host_s in (19.0, 19.5):
        known.add(ping(clock, host_s, 3e-4, 0.0, 2e-4))
    assert known.irregular
    low_us, high_us = known.offset_us(19.1, 19.4)
    assert low_us <= clock.board_us(19.3) - 19.3e6 <= high_us
    assert high_us - low_us < 1500
    with pytest.raises(ValueError, match=r"no pings before 19\.6 s"):
        known.offset_us(19.6, 19.7)


def test_a_crystal_is_never_taken_for_irregular() -> None:
    rng = np.random.default_rng(8)
    clock, known = TrueClock(rng), ClockMap()
    for number in range(400):
        known.add(jittered(clock, 10 + 0.033 * number, rng))
    assert not known.irregular
    assert known.offset_us(22.9, 23.0).error <= board_us(known, 22.95).error + 20


def steady(*host_s: float) -> tuple[TrueClock, ClockMap]:
    """A clock as fast as the host's, and pings of no duration."""
    clock, known = TrueClock(np.random.default_rng(9)), ClockMap()
    clock.offset_us, clock.drift, clock.wander = 1000.0, 0.0, 0.0
    for now_s in host_s:
        known.add(ping(clock, now_s, 0.0, 0.0, 0.0))
    return clock, known


def test_drift_is_known_but_for_two_millionths_that_temperature_may_change() -> None:
    _, known = steady(0, 10, 20, 29)
    assert 1.9e-6 < known.drift.error < 2.2e-6
    assert 20 < board_us(known, 39.0).error < 24, "10 s after the last"


@pytest.mark.parametrize(("off_us", "jumps"), [(4990, 0), (-4990, 0), (5010, 1), (-5010, 1)])
def test_a_ping_that_is_five_milliseconds_off_is_of_another_start(off_us: float, jumps: int) -> None:
    clock, known = steady(*range(8))
    clock.offset_us += off_us
    known.add(ping(clock, 7.01, 0.0, 0.0, 0.0))
    assert known.jumps == jumps


@pytest.mark.parametrize(("back_s", "sure"), [(0.00498, True), (0.00502, False)])
def test_a_ping_of_five_milliseconds_would_not_show_a_jump(back_s: float, sure: bool) -> None:
    clock, known = steady(*range(8))
    known.add(ping(clock, 8, 0.0, 0.0, back_s))
    assert known.covers(7.5, 7.9) == sure


def test_contradictions_are_forgotten_after_half_a_minute_and_sure_pings_after_forty_eight() -> None:
    clock, known = steady(10)
    clock.offset_us -= 3000
    for now_s in range(11, 71):
        known.add(ping(clock, now_s, 0.0, 0.0, 0.0))
        assert (known.noise_us > 0) == (now_s < 42), now_s
    assert known.covers(23.1, 69.9)
    assert not known.covers(22.9, 69.9)
