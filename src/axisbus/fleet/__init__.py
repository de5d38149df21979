"""Observe and command the machines of a plant over its Zenoh network: the protocol, and the client for programs and people."""
