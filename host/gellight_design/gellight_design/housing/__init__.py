"""The housing to print: closed solids that hold gel, ring and camera where the geometry puts them."""
