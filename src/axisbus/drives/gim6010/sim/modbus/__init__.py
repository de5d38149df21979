"""A simulated GIM6010-8 on RS485: Modbus RTU as in the manual (v2.2, 4.3), served on a pseudo-terminal."""
