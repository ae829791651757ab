"""Under which light was a frame taken: sequencing the ring, and tying its lights to the frames of the camera.

`sequence_choice` makes the light groups of a sequence. `hold` shows light groups one by one and returns a clean frame
of each; `sequenced` labels a stream of frames. They stand on `clock` (board and host), `timeline` (what was lit when),
`label` (exposure against light), `light_watch` (what the ring says was lit) and `lock` (how many frames a light has to
stay, and when it changes).
"""
