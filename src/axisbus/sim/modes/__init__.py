"""The modes of operation of the stand-in drive, one module each (velocity and torque modes in pairs)."""
