"""A simulated GIM6010-8 with CAN Simple, from the manual v2.2 and owners' measurements, independent of the master's codec."""
