"""A calibration service that says what a test lets it say, and remembers what it was asked for."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.bundle.store import ListedBundle
from gellight.daemon.calibration_service import CalibrationRequest, CalibrationState
from gellight.daemon.needs import Need

STEPS = ("prepare", "reference", "pixel_size", "presses", "fit", "verify")
WIDTH, HEIGHT = 640, 480


def snapshot(step: str, **news: Any) -> dict[str, Any]:
    """What the routine shows at a step, with `news` in place of nothing."""
    done = STEPS.index(step) if step in STEPS else len(STEPS) * (step == "finished")
    now: dict[str, Any] = {
        "version": 1,
        "step": step,
        "steps": [
            {"name": name, "state": "done" if i < done else "now" if name == step else "to do"}
            for i, name in enumerate(STEPS)
        ],
        "instruction": "Do something.",
        "actions": ["abort"],
        "progress": {},
        "problem": "",
        "figures": {},
        "advice": "",
        "bundle": "",
        "pictures": [],
    }
    return {**now, **news}


def pressing(**news: Any) -> dict[str, Any]:
    """The routine in the middle of the ball presses."""
    places = [[(row * 8 + column) % 4 for column in range(8)] for row in range(6)]
    slopes = [[300 - 40 * band + 20 * direction for band in range(5)] for direction in range(8)]
    return snapshot(
        "presses",
        **{
            "instruction": "Press the ball of 4 mm radius, 1 to 2 mm deep, at ever other places.",
            "actions": ["next", "correct", "drop", "abort"],
            "progress": {"done": 18, "wanted": 40, "unit": "presses"},
            "advice": "4 places are empty on the left edge: about 2 more presses",
            "press": {
                "number": 18,
                "center_x_px": 300.0,
                "center_y_px": 200.0,
                "contact_radius_px": 60.0,
                "state": "taken",
            },
            "figures": {
                "reference": {"noise_grey": 1.02, "drift_grey": 0.004},
                "pixel_size": {"x_mm": 0.0588, "y_mm": 0.0589, "spread_px": 0.008},
                "presses": {
                    "coverage": {
                        "places": places,
                        "slopes": slopes,
                        "steepness_deg": [0, 10, 20, 30, 40, 90],
                        "steepest_deg": 34.1,
                    },
                    "held_out": [[5, 3.4], [8, 2.2], [12, 1.7], [18, 1.45]],
                },
            },
            "pictures": ["live", "press", "difference"],
            **news,
        },
    )


def stored(identity: str, **news: Any) -> ListedBundle:
    """A bundle of the store, as a list shows it."""
    return ListedBundle(
        sensor="E6605838833A5D2F", identity=identity, path=Path("bundles") / identity, **{"report": False, **news}
    )


class Scripted:
    """Says `routine`; refuses with `refusal` where there is one."""

    def __init__(self) -> None:
        self.routine: dict[str, Any] | None = None
        self.bundles: list[ListedBundle] = []
        self.interrupted = False
        self.simulated = False
        self.hand = False
        self.needs: tuple[Need, ...] = ()
        self.refusal = ""
        self.preparation = self.interrupted_preparation = ""
        self.asked: list[Any] = []

    def state(self) -> CalibrationState:
        return CalibrationState(
            sensor="E6605838833A5D2F",
            simulated=self.simulated,
            defaults=CalibrationRequest(),
            interrupted=self.interrupted,
            in_service="0123456789abcdef",
            bundles=tuple(self.bundles),
            units=tuple(bundle for bundle in self.bundles if bundle.in_service),
            routine=self.routine,
            hand=self.hand,
            needs=self.needs,
            picture=self.preparation,
            interrupted_picture=self.interrupted_preparation,
        )

    def _ask(self, *what: Any) -> None:
        self.asked.append(what)
        if self.refusal:
            raise InputError(self.refusal)

    def begin(self, request: CalibrationRequest) -> None:
        self._ask("begin", request)

    def act(self, action: str, **arguments: float) -> None:
        self._ask(action, arguments)

    def restore(self, identity: str) -> None:
        self._ask("restore", identity)

    def report(self, identity: str) -> bytes:
        if identity != "a" * 16:
            raise BundleError(f"bundle {identity} has no report")
        return b"<!doctype html><title>Calibration of A17</title><style>h1 { color: red }</style><h1>Report</h1>"

    def picture(self, name: str) -> NDArray[np.uint8]:
        if name not in {"live", *(self.routine or {}).get("pictures", [])}:
            raise InputError(f"there is no picture {name!r} yet")
        rows, columns = np.indices((HEIGHT, WIDTH))
        planes = [
            120 + 80 * np.cos((columns - 640 * np.cos(a)) / 300 + (rows - 480 * np.sin(a)) / 250) for a in (0, 2, 4)
        ]
        return np.stack(planes, axis=2).astype(np.uint8)
