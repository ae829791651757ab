"""The frame path in C: built once for each processor, loaded without a compiler, checked against NumPy at load."""
