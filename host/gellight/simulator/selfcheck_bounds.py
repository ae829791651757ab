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
        ("BALL", 0.4): (0.005, 0.0714, 0, 0.2026),
        ("BALL", 0.8): (0.006, 0.0785, 0.0001, 0.2026),
        ("BALL", 1.2): (0.0062, 0.085, 0.0002, 0.2039),
        ("BALL", 1.6): (0.0045, 0.0988, 0.0003, 0.2097),
        ("BALL", 2): (0.0092, 0.1431, 0.0007, 0.2319),
        ("TSTEP", 0.4): (0.0051, 0.1376, 0.001, 0.2172),
        ("TSTEP", 0.8): (0.0274, 0.3009, 0.0027, 0.3439),
        ("TSTEP", 1.2): (0.0673, 0.9778, 0.0055, 0.6422),
        ("TSTEP", 1.6): (0.0961, 2.1258, 0.0079, 1.2895),
        ("TSTEP", 2): (0.1643, 3.355, 0.0071, 2.2053),
        ("SCROWN", 0.4): (0.0052, 0.071, 0.0001, 0.2037),
        ("SCROWN", 0.8): (0.0075, 0.0744, 0.0001, 0.2025),
        ("SCROWN", 1.2): (0.0223, 0.1432, 0.0005, 0.2244),
        ("SCROWN", 1.6): (0.0346, 0.741, 0.0051, 0.5871),
        ("SCROWN", 2): (0.0987, 1.7764, 0.0074, 1.3355),
        ("BALLVEX", 0.4): (0.0089, 0.128, 0.0006, 0.2124),
        ("BALLVEX", 0.8): (0.0112, 0.2341, 0.0019, 0.2573),
        ("BALLVEX", 1.2): (0.0298, 0.7207, 0.0029, 0.501),
        ("BALLVEX", 1.6): (0.0461, 1.7578, 0.0043, 1.0858),
        ("BALLVEX", 2): (0.1093, 2.9696, 0.0052, 1.9061),
        ("BALLCAVE", 0.4): (0.0266, 0.3752, 0.0035, 0.3983),
        ("BALLCAVE", 0.8): (0.0501, 1.6653, 0.0056, 1.163),
        ("BALLCAVE", 1.2): (0.1468, 2.9928, 0.006, 2.2109),
        ("BALLCAVE", 1.6): (0.4893, 4.0556, 0.0072, 3.641),
        ("BALLCAVE", 2): (0.8586, 5.1282, 0.0055, 5.1777),
        ("WAVE", 0.4): (0.0101, 0.3808, 0.004, 0.502),
        ("WAVE", 0.8): (0.0361, 1.838, 0.0059, 1.3408),
        ("WAVE", 1.2): (0.1211, 4.1082, 0.0063, 3.0596),
        ("WAVE", 1.6): (0.3601, 5.541, 0.0075, 3.7786),
        ("WAVE", 2): (0.6825, 6.9406, 0.0072, 4.6179),
        ("SINWAVE", 0.4): (0.0145, 0.328, 0.004, 0.4251),
        ("SINWAVE", 0.8): (0.0371, 1.2516, 0.007, 1.0093),
        ("SINWAVE", 1.2): (0.0937, 3.0242, 0.0086, 2.1691),
        ("SINWAVE", 1.6): (0.1811, 4.274, 0.0089, 2.8393),
        ("SINWAVE", 2): (0.3396, 5.6994, 0.0084, 3.5494),
        ("BSWAVE", 0.4): (0.0083, 0.154, 0.001, 0.2399),
        ("BSWAVE", 0.8): (0.0317, 0.3499, 0.0039, 0.3983),
        ("BSWAVE", 1.2): (0.0537, 1.1724, 0.0068, 0.9667),
        ("BSWAVE", 1.6): (0.0734, 2.7199, 0.0079, 1.9531),
        ("BSWAVE", 2): (0.1372, 4.0805, 0.008, 2.7466),
        ("PCONVEX", 0.4): (0.0204, 0.3281, 0.0028, 0.3721),
        ("PCONVEX", 0.8): (0.0469, 1.4848, 0.0051, 1.1127),
        ("PCONVEX", 1.2): (0.1055, 4.3897, 0.0066, 2.5575),
        ("PCONVEX", 1.6): (0.1619, 7.1098, 0.007, 3.9397),
        ("PCONVEX", 2): (0.2292, 9.0258, 0.0065, 5.048),
        ("CCONVEX", 0.4): (0.0064, 0.1623, 0.0009, 0.2341),
        ("CCONVEX", 0.8): (0.0168, 0.3491, 0.0024, 0.3528),
        ("CCONVEX", 1.2): (0.0408, 1.1792, 0.0037, 0.7569),
        ("CCONVEX", 1.6): (0.0662, 2.7212, 0.0045, 1.571),
        ("CCONVEX", 2): (0.1263, 4.1403, 0.005, 2.4452),
        ("QUCAVE", 0.4): (0.0218, 0.3907, 0.0034, 0.4053),
        ("QUCAVE", 0.8): (0.0413, 1.8579, 0.0059, 1.2816),
        ("QUCAVE", 1.2): (0.1404, 4.3043, 0.0055, 2.6835),
        ("QUCAVE", 1.6): (0.4155, 6.2645, 0.0068, 4.2794),
        ("QUCAVE", 2): (0.7568, 7.7397, 0.0065, 5.7796),
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
