"""The frame paths of single pictures: a camera frame in, a tactile frame out."""
