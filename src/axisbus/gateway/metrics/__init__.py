"""Figures of a machine for Prometheus: pure families, and a server that is asked for them."""
