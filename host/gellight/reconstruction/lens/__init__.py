"""Lens distortion, taken out of the gradient map."""
