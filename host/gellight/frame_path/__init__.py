"""The frame paths of single pictures: a camera frame in, a tactile frame out.

pipeline.py       Reconstructor: in C where there is a library for the processor, else in NumPy
numpy_path.py     that way in NumPy, SciPy and OpenCV
sequence_path.py  that way under a changing light
picture_path.py   the picture alone, where nothing can be felt
"""
