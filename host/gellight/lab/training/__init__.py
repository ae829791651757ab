"""From labelled presses to a network.

presses.py           ball presses, and the shape of the gel under the ball
label_file.py        the csv of labels beside its images
table.py             the table that GelNet is trained on
child.py             a module of gelnet run in a child process
training.py          GelNet trained on the table, and written as a bundle; whether it can be trained here
polynomial.py        polynomials of several variables, and their fit
validation.py        errors of a bundle on labelled presses
wrong_labels.py      labels that the other presses and their picture contradict
votes.py             which labels of the same presses are better
judged_fit.py        a calibration that tells its errors by them
light_change.py      how the light has changed, by the untouched gel alone
adapting.py          a bundle for that light, without a press
synthetic.py         the bundle of the simulated sensor; balls pressed into it
labelling/           contact circles without clicks
"""
