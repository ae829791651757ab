"""Within which errors a press has to be measured: what was measured on a grid of objects and depths, and a margin.

The bounds notice a change for the worse; they are no promise of accuracy. Beyond the grid nothing is known, so nothing
is judged. `python -m tests.benchmarks.selfcheck_bounds` measures the table: the shipped bundle, the simulated sensor of
the paper, the worst of three places.
"""

from types import MappingProxyType

from gellight.frames.frames import GroundTruth
from sim_reference.geometry import SensorGeometry

KINDS = ("depth_error_mm", "normal_error_deg", "integral_error_mm", "picture_error_grey")
"""columns of `ERRORS`; nothing is taken off the depth"""
SMALLEST = MappingProxyType(dict(zip(KINDS, (0.010, 0.28, 0.005, 2.0), strict=True)))
"""No bound is narrower. The paper reports 0.02 mm and 0.28 degrees for its ball (section 3.2.5)."""
MARGIN = 1.3
PLACES_MM = (10.0, 6.0)
"""how far from the middle of the view in x and y it was measured"""
ERRORS = MappingProxyType(
    {
        ("BALL", 0.4): (0.001, 0.0735, 0.0001, 0.2018),
        ("BALL", 0.8): (0.0017, 0.0776, 0.0001, 0.2013),
        ("BALL", 1.2): (0.0037, 0.0844, 0.0002, 0.2029),
        ("BALL", 1.6): (0.0058, 0.0966, 0.0002, 0.2078),
        ("BALL", 2): (0.0113, 0.1369, 0.0006, 0.2273),
        ("TSTEP", 0.4): (0.014, 0.1221, 0.0005, 0.2199),
        ("TSTEP", 0.8): (0.0236, 0.2531, 0.0017, 0.3094),
        ("TSTEP", 1.2): (0.0319, 0.9716, 0.005, 0.6629),
        ("TSTEP", 1.6): (0.0311, 2.1848, 0.0098, 1.3352),
        ("TSTEP", 2): (0.0896, 3.3318, 0.011, 2.054),
        ("SCROWN", 0.4): (0.0013, 0.072, 0.0001, 0.2033),
        ("SCROWN", 0.8): (0.0012, 0.0751, 0.0001, 0.2023),
        ("SCROWN", 1.2): (0.0084, 0.1324, 0.0005, 0.2081),
        ("SCROWN", 1.6): (0.0193, 0.7815, 0.0061, 0.6115),
        ("SCROWN", 2): (0.0394, 1.7484, 0.0093, 1.1723),
        ("BALLVEX", 0.4): (0.0109, 0.1236, 0.0005, 0.2116),
        ("BALLVEX", 0.8): (0.0098, 0.2119, 0.0016, 0.2472),
        ("BALLVEX", 1.2): (0.0117, 0.683, 0.0029, 0.4678),
        ("BALLVEX", 1.6): (0.0198, 1.792, 0.0052, 1.0755),
        ("BALLVEX", 2): (0.0389, 2.9092, 0.0059, 1.72),
        ("BALLCAVE", 0.4): (0.0048, 0.3468, 0.0034, 0.3588),
        ("BALLCAVE", 0.8): (0.0195, 1.7518, 0.0062, 1.2002),
        ("BALLCAVE", 1.2): (0.0792, 2.9863, 0.0059, 2.1053),
        ("BALLCAVE", 1.6): (0.2231, 3.891, 0.0061, 2.9904),
        ("BALLCAVE", 2): (0.4181, 4.8429, 0.0066, 4.0659),
        ("WAVE", 0.4): (0.007, 0.3542, 0.0037, 0.4788),
        ("WAVE", 0.8): (0.0476, 2.1439, 0.0061, 1.4767),
        ("WAVE", 1.2): (0.2151, 4.6017, 0.007, 3.802),
        ("WAVE", 1.6): (0.2871, 5.664, 0.0069, 4.3546),
        ("WAVE", 2): (0.4328, 6.8226, 0.0068, 5.0385),
        ("SINWAVE", 0.4): (0.0047, 0.2979, 0.0038, 0.3938),
        ("SINWAVE", 0.8): (0.0304, 1.3365, 0.0074, 1.0319),
        ("SINWAVE", 1.2): (0.111, 3.314, 0.0082, 2.5286),
        ("SINWAVE", 1.6): (0.163, 4.4568, 0.0086, 3.2086),
        ("SINWAVE", 2): (0.247, 5.4985, 0.0084, 3.7574),
        ("BSWAVE", 0.4): (0.0124, 0.1494, 0.0009, 0.2349),
        ("BSWAVE", 0.8): (0.0118, 0.3597, 0.004, 0.3873),
        ("BSWAVE", 1.2): (0.0904, 1.3331, 0.0073, 1.1169),
        ("BSWAVE", 1.6): (0.1324, 3.0566, 0.0079, 2.406),
        ("BSWAVE", 2): (0.1515, 4.1733, 0.0085, 3.0186),
        ("PCONVEX", 0.4): (0.0084, 0.3017, 0.0026, 0.3548),
        ("PCONVEX", 0.8): (0.0351, 1.4044, 0.0053, 1.0892),
        ("PCONVEX", 1.2): (0.035, 4.1605, 0.0068, 2.4826),
        ("PCONVEX", 1.6): (0.0781, 6.7124, 0.0077, 3.6464),
        ("PCONVEX", 2): (0.1446, 8.4201, 0.0078, 4.6094),
        ("CCONVEX", 0.4): (0.0189, 0.1526, 0.0009, 0.2475),
        ("CCONVEX", 0.8): (0.0168, 0.3181, 0.0022, 0.3396),
        ("CCONVEX", 1.2): (0.0144, 1.1583, 0.0036, 0.7447),
        ("CCONVEX", 1.6): (0.0265, 2.7633, 0.0051, 1.6036),
        ("CCONVEX", 2): (0.0521, 4.0729, 0.0056, 2.3146),
        ("QUCAVE", 0.4): (0.0054, 0.3549, 0.0034, 0.3723),
        ("QUCAVE", 0.8): (0.0228, 1.948, 0.0063, 1.3331),
        ("QUCAVE", 1.2): (0.0734, 4.5215, 0.006, 2.8255),
        ("QUCAVE", 1.6): (0.197, 6.4337, 0.0064, 4.0507),
        ("QUCAVE", 2): (0.3596, 7.822, 0.0067, 5.2024),
    }
)
"""worst errors by object and press depth in mm"""
DEEPEST_MM = max(depth for _, depth in ERRORS)


def bounds_of(truth: GroundTruth, geometry: SensorGeometry) -> tuple[dict[str, float], str]:
    """Return the largest errors allowed of a press, by kind, and ""; or none, and why the press is not judged."""
    if not truth.object_name and not truth.contact.any():
        return dict(SMALLEST), ""
    why = _unknown(truth, geometry)
    if why:
        return {}, why
    name, depth_mm = truth.object_name, truth.press_depth_mm
    deeper = min(depth for known, depth in ERRORS if known == name and depth >= depth_mm)
    rows = [errors for (known, depth), errors in ERRORS.items() if known == name and depth <= deeper]
    worst = [MARGIN * max(column) for column in zip(*rows, strict=True)]
    return {kind: max(SMALLEST[kind], error) for kind, error in zip(KINDS, worst, strict=True)}, ""


def _unknown(truth: GroundTruth, geometry: SensorGeometry) -> str:
    """Return why there are no bounds; empty where there are."""
    if geometry != SensorGeometry():
        return "not judged: bounds were measured for the default sensor only"
    if not any(known == truth.object_name for known, _ in ERRORS):
        return f"not judged: no bounds were measured for {truth.object_name or 'this object'}"
    if truth.press_depth_mm > DEEPEST_MM:
        return f"not judged beyond {DEEPEST_MM:g} mm"
    if any(abs(place) > most for place, most in zip(truth.place_mm, PLACES_MM, strict=True)):
        return f"not judged beyond {PLACES_MM[0]:g} x {PLACES_MM[1]:g} mm from the middle"
    return ""
