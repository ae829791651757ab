"""What is chosen of a simulation: names alone, for who offers them computes nothing."""

from typing import Literal

GelKind = Literal["layer", "fem"]
"""how the gel is computed: as an elastic layer of small strain, a second a press; or by finite elements, a minute"""
RESOLUTION_MM = 0.3
"""of the finite elements"""
LightKind = Literal["ring", "singles"]
"""one picture under the whole ring in its colours; or one a LED, all in white"""
