"""Modbus RTU of the GIM6010-8 over RS485 (manual v2.2, 4.3): registers, their codec, and a client."""
