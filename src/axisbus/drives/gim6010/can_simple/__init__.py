"""CAN Simple, which a GIM6010-8 speaks when it leaves its factory: its messages as tables, read and written without any I/O."""
