"""Shared code of the tests of Modbus: a wire in virtual time, and modules on it."""
