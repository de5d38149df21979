"""The cyclic modes of velocity and torque: a target in each cycle, on ramps that are made here."""
