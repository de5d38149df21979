"""Metrics of a machine for Prometheus: metric families, and a server that Prometheus scrapes."""
