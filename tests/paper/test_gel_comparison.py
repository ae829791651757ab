"""The layer against finite elements, as the report shows it."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.base.errors import InputError
from sim_reference import gel
from sim_reference.deformation import Deformation, NotConverged
from tests.helpers.studies import setup
from tests.paper import gel_comparison
from tests.paper.gel_comparison import GelRow, compare_gels, gel_json, gel_section


def other_gel(kind: str, resolution_mm: float):  # type: ignore[no-untyped-def]
    """A gel that is 10 um deeper everywhere than the layer, and holds twice the force."""

    def press(*given) -> Deformation:  # type: ignore[no-untyped-def]
        layer = gel.press(*given)
        return Deformation(layer.depth_mm + 0.01, layer.pressure * 2, layer.spacing_mm)

    return press


def test_a_row_says_how_far_the_layer_is_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gel_comparison, "gel_model", other_gel)
    row = GelRow(**compare_gels("SCROWN", setup(48)))
    assert row.resolution_mm == gel_comparison.COARSE_MM
    assert row.height_um == pytest.approx(10, abs=0.01)
    assert row.height_in_contact_um == pytest.approx(10, abs=0.01)
    assert row.normals_deg == pytest.approx(0, abs=1e-6)
    assert row.fem_force_n == pytest.approx(2 * row.layer_force_n)
    assert 0.3 < row.layer_force_n < 1.5
    assert "<td>10.0 µm<td>10.0 µm<td>0.00°" in gel_section([row], setup(48))


def test_finite_elements_are_those_of_the_studies_where_they_use_them(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[float] = []
    monkeypatch.setattr(gel_comparison, "gel_model", lambda kind, mm: seen.append(mm) or other_gel(kind, mm))
    compare_gels("SCROWN", replace(setup(48), gel="fem", resolution_mm=0.4))
    assert seen == [0.4]


def test_a_press_that_was_not_found_is_said_and_does_not_end_the_report(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(cause: Exception):  # type: ignore[no-untyped-def]
        def press(*_):  # type: ignore[no-untyped-def]
            raise InputError("this press cannot be simulated") from cause

        return press

    monkeypatch.setattr(gel_comparison, "gel_model", lambda *_: failing(NotConverged("100 steps <were> not enough")))
    found = compare_gels("WAVE", setup(48))
    assert found == {"object_name": "WAVE", "resolution_mm": 0.6, "not_found": "100 steps <were> not enough"}
    row = GelRow(**found)
    assert np.isnan(row.height_um)
    assert gel_json(row) == found
    assert "not found: 100 steps &lt;were&gt; not enough" in gel_section([row], setup(48))
    monkeypatch.setattr(gel_comparison, "gel_model", lambda *_: failing(OSError("disk full")))
    with pytest.raises(InputError):
        compare_gels("WAVE", setup(48))
