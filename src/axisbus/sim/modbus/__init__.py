"""A stand-in of a GIM6010-8 on RS485: Modbus RTU as the manual (v2.2, 4.3) has it, served on a pseudo-terminal."""
