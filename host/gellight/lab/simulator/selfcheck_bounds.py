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
        ("BALL", 0.4): (0.0009, 0.0713, 0.0001, 0.2014),
        ("BALL", 0.8): (0.0022, 0.0772, 0.0001, 0.2013),
        ("BALL", 1.2): (0.0043, 0.0847, 0.0002, 0.2019),
        ("BALL", 1.6): (0.0046, 0.0919, 0.0002, 0.2049),
        ("BALL", 2): (0.0034, 0.1143, 0.0003, 0.215),
        ("TSTEP", 0.4): (0.0048, 0.1282, 0.0004, 0.2156),
        ("TSTEP", 0.8): (0.0125, 0.2367, 0.0013, 0.2839),
        ("TSTEP", 1.2): (0.0468, 0.5937, 0.0049, 0.4793),
        ("TSTEP", 1.6): (0.057, 1.2295, 0.0077, 0.8667),
        ("TSTEP", 2): (0.0802, 2.213, 0.0097, 1.4866),
        ("SCROWN", 0.4): (0.0006, 0.0706, 0.0001, 0.203),
        ("SCROWN", 0.8): (0.0023, 0.0735, 0.0001, 0.202),
        ("SCROWN", 1.2): (0.0064, 0.1324, 0.0004, 0.2066),
        ("SCROWN", 1.6): (0.0116, 0.4227, 0.0016, 0.3946),
        ("SCROWN", 2): (0.0382, 1.1866, 0.0053, 0.8167),
        ("BALLVEX", 0.4): (0.0066, 0.1216, 0.0005, 0.2076),
        ("BALLVEX", 0.8): (0.0046, 0.2055, 0.0015, 0.2347),
        ("BALLVEX", 1.2): (0.0139, 0.5156, 0.0029, 0.3979),
        ("BALLVEX", 1.6): (0.0173, 1.087, 0.0037, 0.7392),
        ("BALLVEX", 2): (0.0362, 1.9562, 0.0051, 1.2302),
        ("BALLCAVE", 0.4): (0.0065, 0.3028, 0.002, 0.3263),
        ("BALLCAVE", 0.8): (0.0163, 1.1215, 0.0041, 0.7878),
        ("BALLCAVE", 1.2): (0.0521, 2.185, 0.006, 1.4245),
        ("BALLCAVE", 1.6): (0.211, 3.6731, 0.0068, 2.5908),
        ("BALLCAVE", 2): (0.4718, 5.4774, 0.006, 4.144),
        ("WAVE", 0.4): (0.0064, 0.336, 0.0029, 0.4611),
        ("WAVE", 0.8): (0.0162, 1.179, 0.005, 1.0007),
        ("WAVE", 1.2): (0.0206, 2.5371, 0.0066, 1.9813),
        ("WAVE", 1.6): (0.1186, 3.9114, 0.0078, 2.7817),
        ("WAVE", 2): (0.3592, 5.5347, 0.0067, 3.7548),
        ("SINWAVE", 0.4): (0.0034, 0.2783, 0.0035, 0.3899),
        ("SINWAVE", 0.8): (0.0228, 0.8587, 0.0064, 0.7903),
        ("SINWAVE", 1.2): (0.0382, 1.9161, 0.0081, 1.4954),
        ("SINWAVE", 1.6): (0.0564, 2.8199, 0.0089, 2.0707),
        ("SINWAVE", 2): (0.2106, 4.1758, 0.0085, 2.7446),
        ("BSWAVE", 0.4): (0.0037, 0.1492, 0.0009, 0.2285),
        ("BSWAVE", 0.8): (0.0149, 0.3018, 0.0031, 0.3485),
        ("BSWAVE", 1.2): (0.0425, 0.8085, 0.0064, 0.6897),
        ("BSWAVE", 1.6): (0.0572, 1.4994, 0.0078, 1.2724),
        ("BSWAVE", 2): (0.0621, 2.3882, 0.0087, 1.8503),
        ("PCONVEX", 0.4): (0.0055, 0.305, 0.0024, 0.3548),
        ("PCONVEX", 0.8): (0.0387, 1.2019, 0.0051, 0.9133),
        ("PCONVEX", 1.2): (0.0772, 2.9421, 0.0074, 1.9747),
        ("PCONVEX", 1.6): (0.1145, 4.818, 0.0077, 3.0142),
        ("PCONVEX", 2): (0.1463, 6.4229, 0.0088, 3.8572),
        ("CCONVEX", 0.4): (0.0089, 0.1553, 0.0009, 0.2378),
        ("CCONVEX", 0.8): (0.0048, 0.2893, 0.002, 0.3076),
        ("CCONVEX", 1.2): (0.0175, 0.8084, 0.0037, 0.5732),
        ("CCONVEX", 1.6): (0.0297, 1.7049, 0.0052, 1.0532),
        ("CCONVEX", 2): (0.0437, 2.7919, 0.006, 1.6425),
        ("QUCAVE", 0.4): (0.006, 0.3376, 0.0023, 0.3526),
        ("QUCAVE", 0.8): (0.022, 1.2522, 0.0043, 0.8961),
        ("QUCAVE", 1.2): (0.0772, 3.147, 0.006, 1.8424),
        ("QUCAVE", 1.6): (0.1573, 5.4014, 0.0077, 3.1868),
        ("QUCAVE", 2): (0.3899, 7.5373, 0.0065, 4.7857),
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
