"""How many times the change of the gel at rest counts as a touch: `python -m tests.benchmarks.rest_times`.

A multiple is chosen on two sensors and judged on the third. Half of a sensor's presses say how much its gel at rest
differs from the reference image (`rest_of_presses`), the other half is judged: how much of the contact circle, and of
what lies beyond 3 contact radii, would count as touched. Chosen is the least multiple that takes no more than
`MOST_FAR` of what lies beyond for touched, on both sensors. On the DIGIT, a second untouched picture tells too.
"""

import tempfile
from pathlib import Path

import numpy as np

from gellight.frames.image_files import read_image
from gellight.lab.training.gel_at_rest import rest_of_presses
from gellight.lab.training.presses import distance_px
from gellight.reconstruction.gelnet import GradientNetwork
from gellight.reconstruction.image_noise import REST_TIMES
from gellight.reconstruction.light_drift import difference_of
from tests.benchmarks.real_sets import SETS, RealSet
from tests.helpers.linear_sensor import linear_network
from tests.helpers.places import real

TIMES = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 10.0)
SENSORS = ("mini", "digit", "dots")
MOST_FAR = 0.05
Shares = dict[float, tuple[float, float, float]]
"""by multiple: the share of the view, of the contact circles, and beyond 3 contact radii that counts as touched"""


def shares(images: RealSet) -> tuple[float, Shares]:
    """Return what the gel at rest differs by, grey levels, and what is touched for each multiple."""
    reference, presses = images.reference, images.presses
    rest = rest_of_presses(presses[::2], reference.image, noise_grey=reference.noise_grey, follow_light=True)
    found: Shares = {}
    for times in TIMES:
        network = _network(images, rest, times)
        rows = []
        for press in presses[1::2]:
            touched = network.touched(difference_of(press.picture(), reference.image, follow_light=True))
            radii = distance_px(press, reference.image_shape) / press.contact_radius_px
            far = touched[radii > 3]
            rows.append((touched.mean(), touched[radii < 1].mean(), far.mean() if far.size else np.nan))
        view, contact, beyond = np.nanmean(rows, axis=0).tolist()
        found[times] = view, contact, beyond
    return rest, found


def _network(images: RealSet, rest: float, times: float) -> GradientNetwork:
    """The mask, with another multiple; the slopes are not asked for."""
    return GradientNetwork(
        linear_network(),
        images.reference.image_shape,
        noise_grey=images.reference.noise_grey,
        rest_grey=rest * times / REST_TIMES,
    )


def chosen(found: Shares) -> float:
    """Return the least multiple under which nearly nothing far from the contact counts as touched."""
    return min((times for times, (_, _, far) in found.items() if far <= MOST_FAR), default=max(TIMES))


def main() -> None:
    """Print a table for each sensor, then what each one's choice is worth on the others."""
    tables: dict[str, Shares] = {}
    for name in SENSORS:
        with tempfile.TemporaryDirectory() as place:
            images = SETS[name](Path(place))
            rest, tables[name] = shares(images)
            print(f"\n{name}: at rest {rest:.2f} grey; touched: view, contact circles, beyond 3 radii")
            for times, figures in tables[name].items():
                print(f"{times:6.1f}" + "".join(f"{100 * figure:9.1f} %" for figure in figures))
            if name == "digit":
                second = read_image(real("digit_ball") / "background.png")
                change = difference_of(second, images.reference.image, follow_light=True)
                for times in TIMES:
                    touched = _network(images, rest, times).touched(change).mean()
                    print(f"{times:6.1f}  a second untouched picture {100 * touched:5.1f} %")
    for name, found in tables.items():
        times = max(chosen(others) for other, others in tables.items() if other != name)
        view, circle, far = found[times]
        print(f"chosen without {name}: {times:g}; on it: circle {circle:.1%}, beyond {far:.1%}, view {view:.1%}")


if __name__ == "__main__":
    main()
