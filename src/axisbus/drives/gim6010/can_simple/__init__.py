"""CAN Simple, the factory protocol of a GIM6010-8: its messages as tables, encoded and decoded without any I/O."""
