"""Photometric stereo: where light comes from, and slopes from pictures under several lights. Arrays in, slopes out."""
