"""Errors on presses of the simulated sensor, as they are printed."""

import pytest

from tests.benchmarks import presses


def test_presses_are_measured_at_three_depths(capsys: pytest.CaptureFixture[str]) -> None:
    presses.main(presses=1)
    printed = [line.split() for line in capsys.readouterr().out.splitlines()]
    rows = {name: [float(word) for word in words] for name, *words in printed}
    assert rows["press_depth_mm"] == [1, 1.5, 2]
    in_contact = rows["contact_normal_mae_deg"]
    assert all(0 < error < 1 for error in in_contact)
    assert in_contact[0] < in_contact[2], "the deeper, the steeper"
