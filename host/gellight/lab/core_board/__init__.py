"""The board of `sim://`: the C core of the firmware, compiled, in this process, on the clock of this computer."""
