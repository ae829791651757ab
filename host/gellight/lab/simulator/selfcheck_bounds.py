"""Within which errors a press has to be measured: what was measured on a grid of objects and depths, and a margin.

The bounds notice a change for the worse; they are no promise of accuracy. Beyond the grid nothing is known, so nothing
is judged. `python -m tests.benchmarks.selfcheck_bounds` measures the table: the shipped bundle, the simulated sensor of
the paper, the worst of three places.
"""

from types import MappingProxyType

from gellight.frames.frames import GroundTruth
from sim_reference.geometry import AS_BUILT, SensorGeometry

KINDS = ("depth_error_mm", "normal_error_deg", "integral_error_mm", "picture_error_grey")
"""columns of `ERRORS`; nothing is taken off the depth"""
SMALLEST = MappingProxyType(dict(zip(KINDS, (0.020, 0.28, 0.005, 2.0), strict=True)))
"""No bound is narrower. The paper reports 0.02 mm and 0.28 degrees for its ball (section 3.2.5), and noise moves the
level of a plate by 0.012 mm from picture to picture."""
MARGIN = 1.3
PLACES_MM = (10.0, 6.0)
"""how far from the middle of the view in x and y it was measured"""
ERRORS = MappingProxyType(
    {
        ("BALL", 0.4): (0.0031, 0.1661, 0.0001, 0.2037),
        ("BALL", 0.8): (0.0031, 0.1703, 0.0001, 0.2039),
        ("BALL", 1.2): (0.0048, 0.1872, 0.0003, 0.2057),
        ("BALL", 1.6): (0.0035, 0.1961, 0.0004, 0.2043),
        ("BALL", 2): (0.0032, 0.2075, 0.0004, 0.2054),
        ("TSTEP", 0.4): (0.0045, 0.2679, 0.0007, 0.214),
        ("TSTEP", 0.8): (0.0124, 0.3068, 0.0012, 0.235),
        ("TSTEP", 1.2): (0.2496, 1.1279, 0.0045, 0.8433),
        ("TSTEP", 1.6): (0.0691, 1.0065, 0.0112, 0.5557),
        ("TSTEP", 2): (0.1095, 1.4843, 0.0132, 0.9212),
        ("SCROWN", 0.4): (0.0019, 0.1638, 0.0001, 0.2047),
        ("SCROWN", 0.8): (0.0043, 0.17, 0.0001, 0.2052),
        ("SCROWN", 1.2): (0.2434, 1.0349, 0.0008, 0.8077),
        ("SCROWN", 1.6): (0.0126, 0.3922, 0.0014, 0.2625),
        ("SCROWN", 2): (0.045, 0.775, 0.0066, 0.614),
        ("BALLVEX", 0.4): (0.0039, 0.262, 0.0007, 0.2059),
        ("BALLVEX", 0.8): (0.002, 0.3081, 0.0013, 0.213),
        ("BALLVEX", 1.2): (0.0069, 0.4388, 0.0024, 0.2496),
        ("BALLVEX", 1.6): (0.0171, 0.61, 0.0037, 0.3786),
        ("BALLVEX", 2): (0.056, 1.0812, 0.0075, 0.7935),
        ("BALLCAVE", 0.4): (0.008, 0.4619, 0.0019, 0.2635),
        ("BALLCAVE", 0.8): (0.0152, 0.6323, 0.0039, 0.459),
        ("BALLCAVE", 1.2): (0.0971, 1.2212, 0.0086, 0.9758),
        ("BALLCAVE", 1.6): (0.2344, 1.9881, 0.0137, 1.4579),
        ("BALLCAVE", 2): (0.4368, 2.988, 0.0184, 1.9509),
        ("WAVE", 0.4): (0.0093, 0.5251, 0.003, 0.4083),
        ("WAVE", 0.8): (0.0134, 0.6234, 0.0055, 0.5357),
        ("WAVE", 1.2): (0.0599, 0.9703, 0.0099, 1.0186),
        ("WAVE", 1.6): (0.1986, 1.5471, 0.0131, 1.5319),
        ("WAVE", 2): (0.3863, 2.2645, 0.0163, 1.986),
        ("SINWAVE", 0.4): (0.0031, 0.4953, 0.0036, 0.3629),
        ("SINWAVE", 0.8): (0.0092, 0.5696, 0.0067, 0.4458),
        ("SINWAVE", 1.2): (0.0261, 0.7095, 0.0087, 0.698),
        ("SINWAVE", 1.6): (0.1045, 1.0869, 0.0098, 1.0703),
        ("SINWAVE", 2): (0.2464, 1.7485, 0.0126, 1.4822),
        ("BSWAVE", 0.4): (0.0059, 0.2808, 0.001, 0.2351),
        ("BSWAVE", 0.8): (0.0073, 0.442, 0.0033, 0.3109),
        ("BSWAVE", 1.2): (0.0252, 0.5097, 0.006, 0.3973),
        ("BSWAVE", 1.6): (0.0344, 0.5616, 0.0082, 0.5192),
        ("BSWAVE", 2): (0.0578, 0.7323, 0.0089, 0.8102),
        ("PCONVEX", 0.4): (0.0069, 0.4992, 0.0024, 0.3055),
        ("PCONVEX", 0.8): (0.0092, 0.6293, 0.0049, 0.4605),
        ("PCONVEX", 1.2): (0.0386, 1.6866, 0.0086, 1.0895),
        ("PCONVEX", 1.6): (0.0531, 3.1153, 0.0096, 1.6326),
        ("PCONVEX", 2): (0.116, 4.3732, 0.0109, 2.2405),
        ("CCONVEX", 0.4): (0.0082, 0.3128, 0.001, 0.2318),
        ("CCONVEX", 0.8): (0.0044, 0.3599, 0.0018, 0.2479),
        ("CCONVEX", 1.2): (0.0124, 0.5523, 0.0033, 0.3524),
        ("CCONVEX", 1.6): (0.0265, 0.8853, 0.0051, 0.5752),
        ("CCONVEX", 2): (0.0664, 1.5446, 0.0083, 1.0429),
        ("QUCAVE", 0.4): (0.0055, 0.4919, 0.0024, 0.2813),
        ("QUCAVE", 0.8): (0.0124, 0.6868, 0.0045, 0.5074),
        ("QUCAVE", 1.2): (0.0657, 1.6242, 0.0095, 1.1973),
        ("QUCAVE", 1.6): (0.2017, 2.8904, 0.0123, 1.867),
        ("QUCAVE", 2): (0.396, 4.0918, 0.0126, 2.4611),
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
    if geometry != AS_BUILT:
        return "not judged: bounds were measured for the default sensor only"
    if not any(known == truth.object_name for known, _ in ERRORS):
        return f"not judged: no bounds were measured for {truth.object_name or 'this object'}"
    if truth.press_depth_mm > DEEPEST_MM:
        return f"not judged beyond {DEEPEST_MM:g} mm"
    if any(abs(place) > most for place, most in zip(truth.place_mm, PLACES_MM, strict=True)):
        return f"not judged beyond {PLACES_MM[0]:g} x {PLACES_MM[1]:g} mm from the middle"
    return ""
