"""What environments with one gel have in common: a sensor that is seeded, what is observed of it, and its picture."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import gymnasium
import numpy as np

from gellight.base.errors import InputError
from gellight.lab.touch.environments.observing import Observing
from gellight.lab.touch.layer import Floats
from gellight.lab.touch.touch_sensor import TouchSensor

Action = TypeVar("Action")


class OneGel(gymnasium.Env[dict[str, Any], Action]):
    """An environment whose agent feels by one gel."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012 - as Gymnasium has it

    def __init__(
        self, observe: Sequence[str], depth_size: int, sensor: Callable[[], TouchSensor], render_mode: str | None
    ) -> None:
        """Make the sensor, and choose what is observed (see `observing.KINDS`). Raises InputError."""
        self._sensor, self.render_mode = sensor(), render_mode
        self.observing = Observing(self._sensor, observe, depth_size)
        self.observation_space = self.observing.space()

    def begin(self, seed: int | None) -> None:
        """Seed the environment where a seed is given, and the noise of the pictures in any case."""
        gymnasium.Env.reset(self, seed=seed)
        self._sensor.seed(int(self.np_random.integers(2**31)))

    def render(self) -> Any:
        """Return the picture of what was felt last, where `render_mode` is rgb_array."""
        felt = self.observing.felt
        return self._sensor.picture(felt) if self.render_mode == "rgb_array" and felt else None


def clipped(action: Floats, count: int) -> list[float]:
    """Return the `count` numbers of an action within -1 to 1; InputError where it is none."""
    numbers = np.asarray(action, np.float64)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise InputError(f"action {numbers.tolist()}: give {count} finite numbers, -1 to 1")
    return [float(one) for one in np.clip(numbers, -1, 1)]
