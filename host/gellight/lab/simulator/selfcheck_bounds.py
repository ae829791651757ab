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
        ("BALL", 0.4): (0.0047, 0.0723, 0.0001, 0.2022),
        ("BALL", 0.8): (0.0059, 0.0781, 0.0001, 0.2029),
        ("BALL", 1.2): (0.0054, 0.0859, 0.0002, 0.2038),
        ("BALL", 1.6): (0.0041, 0.0973, 0.0002, 0.2089),
        ("BALL", 2): (0.0077, 0.1355, 0.0005, 0.2281),
        ("TSTEP", 0.4): (0.0159, 0.1276, 0.0005, 0.225),
        ("TSTEP", 0.8): (0.0283, 0.2673, 0.0018, 0.3134),
        ("TSTEP", 1.2): (0.0405, 0.9923, 0.0055, 0.6876),
        ("TSTEP", 1.6): (0.0432, 2.1949, 0.0084, 1.3596),
        ("TSTEP", 2): (0.0873, 3.3579, 0.0089, 2.0099),
        ("SCROWN", 0.4): (0.0054, 0.0707, 0.0001, 0.2039),
        ("SCROWN", 0.8): (0.0073, 0.0737, 0.0001, 0.2031),
        ("SCROWN", 1.2): (0.0104, 0.1361, 0.0005, 0.2133),
        ("SCROWN", 1.6): (0.0214, 0.7742, 0.0065, 0.612),
        ("SCROWN", 2): (0.0267, 1.7541, 0.0104, 1.108),
        ("BALLVEX", 0.4): (0.0073, 0.1289, 0.0005, 0.2148),
        ("BALLVEX", 0.8): (0.0078, 0.2306, 0.0017, 0.2585),
        ("BALLVEX", 1.2): (0.0135, 0.6881, 0.003, 0.4797),
        ("BALLVEX", 1.6): (0.023, 1.7686, 0.005, 1.0725),
        ("BALLVEX", 2): (0.0332, 2.8989, 0.0067, 1.6625),
        ("BALLCAVE", 0.4): (0.0051, 0.3578, 0.0031, 0.3733),
        ("BALLCAVE", 0.8): (0.0217, 1.7171, 0.0059, 1.1835),
        ("BALLCAVE", 1.2): (0.0568, 2.9039, 0.0074, 1.9014),
        ("BALLCAVE", 1.6): (0.1493, 3.6517, 0.0076, 2.4419),
        ("BALLCAVE", 2): (0.2665, 4.4878, 0.0069, 3.1962),
        ("WAVE", 0.4): (0.0121, 0.3914, 0.0036, 0.5092),
        ("WAVE", 0.8): (0.0558, 2.1755, 0.0059, 1.5284),
        ("WAVE", 1.2): (0.142, 4.3462, 0.0075, 3.4502),
        ("WAVE", 1.6): (0.2031, 5.399, 0.0082, 3.881),
        ("WAVE", 2): (0.3074, 6.4503, 0.0078, 4.3223),
        ("SINWAVE", 0.4): (0.007, 0.3296, 0.0038, 0.4179),
        ("SINWAVE", 0.8): (0.0313, 1.4209, 0.0071, 1.0956),
        ("SINWAVE", 1.2): (0.0931, 3.1616, 0.0085, 2.4146),
        ("SINWAVE", 1.6): (0.1248, 4.2604, 0.0091, 2.9522),
        ("SINWAVE", 2): (0.2043, 5.2272, 0.0085, 3.3549),
        ("BSWAVE", 0.4): (0.0095, 0.1547, 0.001, 0.2408),
        ("BSWAVE", 0.8): (0.0137, 0.3803, 0.0038, 0.4022),
        ("BSWAVE", 1.2): (0.061, 1.24, 0.0073, 1.0272),
        ("BSWAVE", 1.6): (0.0909, 2.9352, 0.0081, 2.2963),
        ("BSWAVE", 2): (0.0823, 4.0811, 0.0088, 2.8925),
        ("PCONVEX", 0.4): (0.0049, 0.3189, 0.0026, 0.3667),
        ("PCONVEX", 0.8): (0.0345, 1.4076, 0.0054, 1.1058),
        ("PCONVEX", 1.2): (0.0634, 4.1402, 0.0068, 2.4739),
        ("PCONVEX", 1.6): (0.1169, 6.7412, 0.0076, 3.646),
        ("PCONVEX", 2): (0.1718, 8.4673, 0.0078, 4.5626),
        ("CCONVEX", 0.4): (0.0149, 0.1628, 0.0009, 0.2521),
        ("CCONVEX", 0.8): (0.0165, 0.342, 0.0022, 0.3552),
        ("CCONVEX", 1.2): (0.0171, 1.1501, 0.0037, 0.749),
        ("CCONVEX", 1.6): (0.031, 2.6989, 0.0053, 1.5637),
        ("CCONVEX", 2): (0.0583, 4.0322, 0.0062, 2.2425),
        ("QUCAVE", 0.4): (0.0057, 0.3723, 0.0032, 0.39),
        ("QUCAVE", 0.8): (0.0292, 1.9316, 0.0063, 1.3452),
        ("QUCAVE", 1.2): (0.0641, 4.3834, 0.0065, 2.6708),
        ("QUCAVE", 1.6): (0.1826, 6.1299, 0.0067, 3.5877),
        ("QUCAVE", 2): (0.3101, 7.3726, 0.007, 4.4202),
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
