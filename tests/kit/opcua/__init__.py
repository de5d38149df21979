"""Clients of OPC UA for tests: asyncua's own, one of another stack, and those that do not behave."""
