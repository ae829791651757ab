"""The simulated gel as files: presses, sequences and data sets, by an elastic layer or by finite elements.

choices.py             names that a verb offers
gel_models.py          the gel as a layer or by finite elements, whose presses are kept, if it fits the memory
one_press.py           one object pressed
solids.py              STL files as objects
written_sequence.py    an object that moves as a file says
dataset.py             many presses, for training other networks
processes.py           many calls of one function, spread over processes
geometry_file.py       a sensor as a settings file
"""
