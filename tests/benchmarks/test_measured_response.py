"""Calibration on the light of real sensors, measured by others: neither our light nor our camera has a part in it."""

import pytest

from tests.benchmarks.measured_response import PRESSES, measure


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["polycalib", "modulus1600_570C_TRLJ", "series2_2EF6_4JNW"])
def test_a_calibration_without_a_click_feels_objects_it_never_saw(name: str) -> None:
    figures = measure(name)
    assert figures["circles_found"] == PRESSES
    assert figures["center_error_px"] < 0.5
    # A flat answer errs by 25 degrees in contact.
    assert 0 < figures["contact_deg"] < 3.0
    assert 0 < figures["whole_map_deg"] < 0.9
    assert figures["contact_deg"] < figures["peer_contact_deg"]
    assert figures["depth_mm"] < figures["peer_depth_mm"]
