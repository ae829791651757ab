"""Surfaces larger than the view: presses side by side become one map of heights, which can be measured.

height_map.py   `HeightMap`: heights on a grid, with their errors, and where nothing is known
"""
