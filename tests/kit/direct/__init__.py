"""Drives without frames for tests of ``motion`` and of the scan: a ``cia402.port.Port`` that calls a simulated drive.

These tests are about decisions, which must be the same however the values travel. What needs frames is tested on a simulated wire
(``axisbus.sim.virtual_can``), with the ports of the product.
"""
