"""GelNet trained by NumPy alone: the network of `network.py`, its derivative by hand, and Adam.

Inside, arrays lie the other way round, one row for each unit and one column for each pixel: so everything but the
matrix products runs along contiguous memory. A batch is worked through in blocks that stay in the processor's cache.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from gelnet.parameters import (
    HEADROOM,
    LEAST_SPREAD,
    PLACE,
    STEEPEST_RAD,
    Floats,
    Layer,
    Parameters,
    layer_sizes,
)
from gelnet.recipes import Recipe

_BLOCK = 256
"""pixels of a batch that are worked through at a time: 32 kB for the activations of a layer of 32 units; whole batches
of 2048 took 2.3 times as long"""
_FADING = np.array([[0.9], [0.999]])
"""of Adam's two moving averages: of the gradient, and of its square"""
_ADAM_EPSILON = np.float32(1e-8)
Loss = Callable[[Floats, Floats], tuple[float, Floats]]
"""of (2, n) gradients found and wanted: the sum over the pixels, and its derivative by what was found"""


class NumpyTrainer:
    """The network, its optimiser, and NumPy's random numbers."""

    version = f"numpy {np.__version__}"

    def __init__(self, *, seed: int) -> None:
        """Seed the random numbers."""
        self._random = np.random.default_rng(seed)

    def order(self, count: int) -> NDArray[np.intp]:
        """Return the numbers below `count` in random order."""
        return self._random.permutation(count)

    def normal(self, count: int, inputs: int) -> Floats:
        """Return (count, inputs) random numbers of mean 0 and standard deviation 1."""
        return self._random.standard_normal((count, inputs), dtype=np.float32)

    def begin(self, pixels: Floats, gradient: Floats, *, width: int, recipe: Recipe) -> None:
        """Start with random weights; the range of inputs and output is that of the training rows."""
        self.begin_with(random_network(pixels, gradient, width=width, random=self._random), recipe)

    def begin_with(self, network: Parameters, recipe: Recipe) -> None:
        """Start with these weights and this range."""
        self._network, self.recipe = network, recipe
        self._values = np.concatenate([part.ravel() for layer in network.layers for part in layer])
        self._moments = np.zeros((2, len(self._values)), np.float32)
        self._steps = 0

    def step(self, pixels: Floats, gradient: Floats, rate: float) -> float:
        """Learn from a batch, (n, C + 2) and (n, 2), at this learning rate; return its loss before the step."""
        loss, derivative = self.loss(pixels, gradient)
        self._steps += 1
        left = self._values * np.float32(1 - rate * self.recipe.weight_decay)
        self._values, self._moments = adam(left, self._moments, derivative, rate=rate, step=self._steps)
        return loss

    def loss(self, pixels: Floats, gradient: Floats) -> tuple[float, Floats]:
        """Return the loss of a batch, and its derivative by all weights and biases in the order of the layers."""
        network = self.parameters()
        total, derivative = 0.0, np.zeros_like(self._values)
        for start in range(0, len(pixels), _BLOCK):
            part = slice(start, start + _BLOCK)
            kept = None
            if self.recipe.dropout:
                kept = kept_units((network.width, 2 * len(pixels[part])), self.recipe.dropout, self._random)
            loss, of_block = loss_of_block(network, pixels[part].T, gradient[part].T, self.recipe, kept)
            total += loss
            derivative += of_block
        return total / len(pixels), np.asarray(derivative / len(pixels), np.float32)

    def answer(self, pixels: Floats) -> Floats:
        """Return the (N, 2) gradients of (N, C + 2) pixels."""
        network = self.parameters()
        blocks = [pixels[start : start + _BLOCK].T for start in range(0, len(pixels), _BLOCK)]
        found = [gradient_of(forward(network, block)[-1], network.steepest_rad).T for block in blocks]
        return np.concatenate([np.zeros((0, 2), np.float32), *found])

    def parameters(self) -> Parameters:
        """Return what has been learnt so far."""
        layers, start = [], 0
        for inputs, units in layer_sizes(self._network.width, len(self._network.centre)):
            middle, end = start + inputs * units, start + (inputs + 1) * units
            layers.append(Layer(self._values[start:middle].reshape(units, inputs), self._values[middle:end]))
            start = end
        ranges = self._network
        return Parameters(
            layers=tuple(layers), centre=ranges.centre, scale=ranges.scale, steepest_rad=ranges.steepest_rad
        )


def random_network(pixels: Floats, gradient: Floats, *, width: int, random: np.random.Generator) -> Parameters:
    """Return a network with random weights, as torch draws them, for (N, C + 2) pixels and their (N, 2) gradients."""
    layers = []
    for inputs, units in layer_sizes(width, pixels.shape[1]):
        bound = 1 / np.sqrt(inputs)
        weight, bias = random.uniform(-bound, bound, (units, inputs)), random.uniform(-bound, bound, units)
        layers.append(Layer(weight.astype(np.float32), bias.astype(np.float32)))
    spread = pixels.std(axis=0, ddof=1, dtype=np.float64) if len(pixels) > 1 else np.zeros(pixels.shape[1])
    steepest = HEADROOM * float(np.arctan(np.abs(gradient).max()))
    return Parameters(
        layers=tuple(layers),
        centre=pixels.mean(axis=0, dtype=np.float64).astype(np.float32),
        scale=np.where(spread > LEAST_SPREAD, spread, 1).astype(np.float32),
        steepest_rad=min(max(steepest, 0.1), STEEPEST_RAD),
    )


def forward(network: Parameters, pixels: Floats, kept: Floats | None = None) -> list[Floats]:
    """Return the inputs of each layer for (C + 2, n) pixels, and the last tanh, (2, n).

    kept: (width, n) factors of the inputs of the last layer, for dropout.
    """
    values = [(pixels - network.centre[:, None]) / network.scale[:, None]]
    for layer in network.layers:
        if kept is not None and layer is network.layers[-1]:
            values[-1] = values[-1] * kept
        values.append(np.tanh(layer.weight @ values[-1] + layer.bias[:, None]))
    return values


def gradient_of(answer: Floats, steepest_rad: float) -> Floats:
    """Return the (2, n) gradients that the last tanh means."""
    return np.asarray(np.tan(np.float32(steepest_rad) * answer))


def backward(layers: Sequence[Layer], values: list[Floats], change: Floats, kept: Floats | None = None) -> Floats:
    """Return the derivative of the loss by all weights and biases, one after another in the order of the layers.

    values: what `forward` returned, with the same `kept`. change: (2, n) derivative of the loss by the last tanh.
    """
    parts: list[Floats] = []
    for number in reversed(range(len(layers))):
        inputs, answer = values[number], values[number + 1]
        if kept is not None and number == len(layers) - 2:
            change = change * kept
            answer = np.divide(answer, kept, out=np.zeros_like(answer), where=kept > 0)
        change = change * (1 - answer * answer)
        parts += [change.sum(axis=1), (change @ inputs.T).ravel()]
        change = layers[number].weight.T @ change
    return np.concatenate(parts[::-1])


def kept_units(shape: tuple[int, int], dropout: float, random: np.random.Generator) -> Floats:
    """Return factors that set a share `dropout` of the units to 0 and leave the mean as it is."""
    return ((random.random(shape, dtype=np.float32) >= dropout) / (1 - dropout)).astype(np.float32)


def loss_of_block(
    network: Parameters, pixels: Floats, wanted: Floats, recipe: Recipe, kept: Floats | None = None
) -> tuple[float, Floats]:
    """Return the loss of (C + 2, n) pixels with (2, n) gradients, summed up, and its derivative as `backward` does.

    The network is asked twice, also without the colour change, and that answer is subtracted, as the host does: n
    columns more, so `kept` is (width, 2 n).
    """
    count = pixels.shape[1]
    unchanged = np.concatenate([np.zeros_like(pixels[: -len(PLACE)]), pixels[-len(PLACE) :]])
    values = forward(network, np.concatenate([pixels, unchanged], axis=1), kept)
    gradient = gradient_of(values[-1], network.steepest_rad)
    loss, slope = _LOSSES[recipe.loss](gradient[:, :count] - gradient[:, count:], wanted)
    slope = np.concatenate([slope, -slope], axis=1)
    change = slope * (1 + gradient * gradient) * np.float32(network.steepest_rad)
    return loss, backward(network.layers, values, change, kept)


def _gradient_loss(found: Floats, wanted: Floats) -> tuple[float, Floats]:
    """Mean absolute difference of the two gradients."""
    difference = found - wanted
    return float(np.abs(difference).sum()) / 2, np.sign(difference) / 2


def _normal_loss(found: Floats, wanted: Floats) -> tuple[float, Floats]:
    """Chord between unit normals, which is the angle for small angles and bounded for steep slopes."""
    length, wanted_length = (np.sqrt(1 + (gradient * gradient).sum(axis=0)) for gradient in (found, wanted))
    # The normals are (-x, -y, 1) / length; `sloped` and `up` are the differences of these parts.
    sloped, up = wanted / wanted_length - found / length, 1 / length - 1 / wanted_length
    chord = np.sqrt((sloped * sloped).sum(axis=0) + up * up + np.float32(1e-6))
    along = (up - (found * sloped).sum(axis=0)) / length  # of the difference, along the normal that was found
    return float(chord.sum()), (-sloped - found / length * along) / (length * chord)


_LOSSES: dict[str, Loss] = {"gradient": _gradient_loss, "normal": _normal_loss}


def adam(values: Floats, moments: Floats, derivative: Floats, *, rate: float, step: int) -> tuple[Floats, Floats]:
    """Return the values and the (2, n) moments after Adam's step number `step`, from 1."""
    fading, rest = _FADING.astype(np.float32), (1 - _FADING).astype(np.float32)
    moments = fading * moments + rest * np.stack([derivative, derivative * derivative])
    mean, square = (1 - _FADING**step).ravel()
    length = np.sqrt(moments[1]) / np.float32(np.sqrt(square)) + _ADAM_EPSILON
    return values - np.float32(rate / mean) * moments[0] / length, moments
