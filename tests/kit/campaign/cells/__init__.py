"""Drawn cells: the recipe of a cell, how it is opened, its random commands, and the rules for its simulated motors.

Theory of operation
-------------------
``recipe.draw`` makes a ``CellRecipe`` from a seed: plain values that say everything about a cell. ``opening`` makes the EDS
files, the cell file and the simulated drives of it. ``orders`` has the commands, in units of each axis, with what they are
expected to do. ``rules`` judges the motors against what ``promises`` says for each axis. Velocities, windows and distances of the
other rules of the campaign are in *norm degrees*: 1/400 of the way that an axis goes in a second at its ``max_velocity``.
"""
