"""Calibration on the light of a real sensor, measured by others: neither our light nor our camera has a part in it."""

import pytest

from tests.benchmarks.measured_response import PRESSES, measure


@pytest.mark.nightly
def test_a_calibration_without_a_click_feels_objects_it_never_saw() -> None:
    figures = measure("polycalib")
    assert figures["circles_found"] == PRESSES
    assert figures["center_error_px"] < 0.5
    # A flat answer errs by 25 degrees in contact.
    assert 0 < figures["contact_deg"] < 3.0
    assert 0 < figures["whole_map_deg"] < 0.9
