"""Drives without frames for tests of ``motion`` and of the scan: a ``cia402.port.Port`` that calls a simulated drive.

These tests are about decisions, which must not depend on the transport of the values. Tests that need frames use a simulated wire
(``axisbus.sim.virtual_can``), with the ports of the product.
"""
