"""Drawn cells: the recipe of a cell, how it is opened, its random commands, and the rules for its simulated motors.

Theory of operation
-------------------
``recipe.draw`` makes a ``CellRecipe`` from a seed: plain values that describe a cell completely. ``opening`` makes its EDS
files, cell file and simulated drives. ``orders`` has the commands, in units of each axis, with their expected results.
``rules`` judges the motors by the ``promises`` for each axis. Velocities, windows and distances of the other rules of the
campaign are in *norm degrees*: 1/400 of the distance that an axis moves in a second at its ``max_velocity``.
"""
