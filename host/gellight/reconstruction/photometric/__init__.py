"""Photometric stereo on the sensor: normals from several exposures, each under another part of the light ring."""
