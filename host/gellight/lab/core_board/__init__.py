"""The board of `sim://`: the C core of the firmware, compiled, in this process, on the clock of this computer.

core.py             the compiled core by ctypes; firmware/tools/libraries.py builds the libraries beside it
simulated_board.py  it as a transport, with what its LEDs show
light_timeline.py   which light was shown when
"""
