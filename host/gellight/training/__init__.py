"""From labelled presses to a network.

presses.py     ball presses and their labels; the table that GelNet learns from
training.py    GelNet trained in a child process, and written as a bundle
baselines.py   what simpler models reach on the same presses
validation.py  errors of a bundle on labelled presses
labelling/     contact circles without clicks
"""
