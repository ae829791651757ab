"""GelNet trained by PyTorch, on the processor or on a GPU."""

import os
from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gelnet.network import GelNet
from gelnet.parameters import PLACE, Floats, Layer, Parameters
from gelnet.recipes import Recipe

_ROWS_PER_ANSWER = 65536


class NoGpuError(OSError):
    """There is no GPU that torch can use."""


def device_of(name: str) -> torch.device:
    """Return what computes: "torch" is the processor, "cuda" a GPU; NoGpuError where there is none."""
    if name == "cuda" and not torch.cuda.is_available():
        raise NoGpuError(f"torch {torch.__version__} finds no GPU (CUDA): compute with torch or numpy")
    return torch.device("cuda" if name == "cuda" else "cpu")


def name_of(device: torch.device) -> str:
    """Return the name of what computes, with the version of torch."""
    name = torch.cuda.get_device_name(device) if device.type == "cuda" else "processor"
    return f"{name}, torch {torch.__version__}"


class TorchTrainer:
    """The network, its optimiser, and torch's random numbers."""

    def __init__(self, *, seed: int, threads: int = 1, by: str = "torch") -> None:
        """Seed torch, and make it repeat itself. by: as `device_of` has it, which raises NoGpuError.

        Random numbers are the processor's, so that a GPU draws the same.
        """
        os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # else cuBLAS does not repeat itself
        self._device = device_of(by)
        self.version = name_of(self._device) if by == "cuda" else f"torch {torch.__version__}"
        torch.set_num_threads(threads)
        torch.set_deterministic_debug_mode("error")  # as use_deterministic_algorithms, which loads its compiler too
        torch.manual_seed(seed)

    def order(self, count: int) -> NDArray[np.intp]:
        """Return the numbers below `count` in random order."""
        return np.asarray(torch.randperm(count).numpy())

    def normal(self, count: int, inputs: int) -> Floats:
        """Return (count, inputs) random numbers of mean 0 and standard deviation 1."""
        return np.asarray(torch.randn((count, inputs)).numpy())

    def begin(self, pixels: Floats, gradient: Floats, *, width: int, recipe: Recipe) -> None:
        """Start with random weights; the range of inputs and output is that of the training rows."""
        self.recipe = recipe
        self.network = GelNet(width, inputs=pixels.shape[1], dropout=recipe.dropout)
        self.network.fit_range(torch.from_numpy(pixels), torch.from_numpy(gradient))
        self.network.to(self._device)
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(), lr=recipe.learning_rate, weight_decay=recipe.weight_decay, fused=True
        )

    def step(self, pixels: Floats, gradient: Floats, rate: float) -> float:
        """Learn from a batch, (n, C + 2) and (n, 2), at this learning rate; return its loss before the step."""
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        loss = self.loss(pixels, gradient)
        self.optimiser.zero_grad()
        torch.autograd.backward(loss)
        self.optimiser.step()
        return float(loss.detach())

    def loss(self, pixels: Floats, gradient: Floats) -> Tensor:
        """Return the loss of a batch; the answers to unchanged pixels are subtracted, as the host does."""
        self.network.train()
        seen = self._given(pixels)
        unchanged = torch.cat([torch.zeros_like(seen[:, : -len(PLACE)]), seen[:, -len(PLACE) :]], dim=1)
        found = self.network(seen) - self.network(unchanged)
        return _LOSSES[self.recipe.loss](found, self._given(gradient))

    def answer(self, pixels: Floats) -> Floats:
        """Return the (N, 2) gradients of (N, C + 2) pixels."""
        self.network.eval()
        with torch.no_grad():
            blocks = torch.split(self._given(pixels), _ROWS_PER_ANSWER)
            return np.asarray(torch.cat([self.network(block) for block in blocks]).cpu().numpy())

    def _given(self, rows: Floats) -> Tensor:
        return torch.from_numpy(rows).to(self._device)

    def parameters(self) -> Parameters:
        """Return what has been learnt so far."""
        layers = [
            Layer(_taken(layer.weight), _taken(layer.bias))
            for layer in (*self.network.hidden, self.network.output)
            if isinstance(layer, nn.Linear)
        ]
        return Parameters(
            layers=tuple(layers),
            centre=_taken(self.network.centre),
            scale=_taken(self.network.scale),
            steepest_rad=float(self.network.steepest_rad),
        )


def _taken(values: Tensor) -> Floats:
    return np.asarray(values.detach().cpu().numpy().copy())


def _gradient_loss(found: Tensor, wanted: Tensor) -> Tensor:
    return torch.mean(torch.abs(found - wanted))


def _normal_loss(found: Tensor, wanted: Tensor) -> Tensor:
    """Mean chord between unit normals, which is the angle for small angles and bounded for steep slopes."""
    squared = (_normal(found) - _normal(wanted)).square().sum(dim=1)
    return torch.mean(torch.sqrt(squared + 1e-6))


_LOSSES: dict[str, Callable[[Tensor, Tensor], Tensor]] = {"gradient": _gradient_loss, "normal": _normal_loss}


def _normal(gradient: Tensor) -> Tensor:
    normal = torch.cat([-gradient, torch.ones_like(gradient[:, :1])], dim=1)
    return nn.functional.normalize(normal, dim=1)
