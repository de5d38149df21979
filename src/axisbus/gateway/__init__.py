"""Gateways to other systems of plants and robots: each is a separate program at a machine, in a process of its own."""
