"""GelNet: five fully connected layers with tanh, a pixel's colour change and place in, the slope of the gel out.

The paper (section 3.2.4, figure 6b) gives the layers, the activation and the dropout before the last layer, but not the
width. Its last tanh bounds the answer "to satisfy the range to gradient". Here the tanh bounds the angle of the slope
and the gradient is its tangent: a gradient has no natural bound, an angle has one. On simulated validation presses
(two seeds) this is never worse than a tanh-scaled gradient: 1.08 and 1.09 against 1.10 and 1.10 degrees with camera
noise, 0.43 and 0.46 against 0.47 and 0.46 without. On real validation presses the two differ by 0.03 degrees.
"""

import torch
from torch import Tensor, nn

from gelnet.parameters import HEADROOM, LEAST_SPREAD, STEEPEST_RAD, layer_sizes


class GelNet(nn.Module):
    """Map (N, C + 2) pixels (change of C channels, x, y in px) to (N, 2) gradients d(depth)/dx, d(depth)/dy.

    Normalisation is inside: `centre` and `scale` of the inputs and `steepest_rad` of the output come from the
    training table by `fit_range`, and travel with the weights. N is free, also 0.
    """

    centre: Tensor
    scale: Tensor
    steepest_rad: Tensor

    def __init__(self, width: int, *, inputs: int = 5, dropout: float = 0.0) -> None:
        """Build with `width` units in each hidden layer; dropout is a probability in [0, 1)."""
        super().__init__()
        if not 0 <= dropout < 1:
            raise ValueError(f"dropout {dropout} of width {width} must be in [0, 1)")
        *hidden, output = layer_sizes(width, inputs)
        self.hidden = nn.ModuleList(nn.Linear(*size) for size in hidden)
        self.dropout = nn.Dropout(dropout)
        self.output = nn.Linear(*output)
        self.register_buffer("centre", torch.zeros(inputs))
        self.register_buffer("scale", torch.ones(inputs))
        self.register_buffer("steepest_rad", torch.tensor(STEEPEST_RAD))

    @property
    def width(self) -> int:
        """Units in each hidden layer."""
        return self.output.in_features

    def fit_range(self, pixels: Tensor, gradient: Tensor) -> None:
        """Take the range of inputs and output from (N, C + 2) training pixels and their (N, 2) gradients."""
        self.centre.copy_(pixels.mean(dim=0))
        spread = pixels.std(dim=0)
        # A column that never changes says nothing: leave its scale at 1 instead of dividing by nothing.
        self.scale.copy_(torch.where(spread > LEAST_SPREAD, spread, torch.ones_like(spread)))
        steepest = float(torch.atan(gradient.abs().max())) * HEADROOM
        self.steepest_rad.fill_(min(max(steepest, 0.1), STEEPEST_RAD))

    def forward(self, pixels: Tensor) -> Tensor:
        """Return (N, 2) gradients of (N, C + 2) pixels."""
        x = (pixels - self.centre) / self.scale
        for layer in self.hidden:
            x = torch.tanh(layer(x))
        angle: Tensor = self.steepest_rad * torch.tanh(self.output(self.dropout(x)))
        return torch.tan(angle)
