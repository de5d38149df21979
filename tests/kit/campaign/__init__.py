"""Random commands and random faults on cells of many kinds, judged on the plants; scripts replay exactly and can be shrunk.

Theory of operation
-------------------

``script`` makes a list of plain events from a seed, for one of the ``scenes``. ``play`` runs it on a fresh cell and returns the
first ``Violation``, or None if all ``rules`` held in every cycle. ``shrink`` leaves events out as long as the same rule is
violated. Nothing here reads a clock: the same script gives the same plant.
"""
