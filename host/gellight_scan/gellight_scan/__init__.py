"""Surfaces larger than the view: presses side by side become a map of heights, which can be measured, or a mesh.

tracking/        where the object in the gel has gone, from frame to frame
contact_view.py  one press as the tracker sees it, and its height
presses.py       settled presses in a stream of frames
search.py        where two presses may lie beside each other
pairs.py         two presses joined, or not
pose_graph.py    places of all presses at once
levelling.py     height, tilt and common bend of the presses
fusion.py        presses in their places, as one map
scan.py          a scan that grows press by press
scan_files.py    its folder
touches.py       touches of a body that is rolled, in a stream of frames
body_scan.py     a scan of a body that grows touch by touch
body.py          touches in their places, as one mesh
beside.py        a scan beside the stream of a running sensor, for the page
height_map.py    `HeightMap`: heights on a grid, with their errors, and where nothing is known; one press as such a map
filtering.py     form and waviness, by the Gaussian filter of ISO 16610
roughness.py     Sa, Sq, Sz, Ra, Rq, Rz, how far they are to be believed, and when they are refused
map_files.py     a map as PNG, X3P, PLY and STL
"""
