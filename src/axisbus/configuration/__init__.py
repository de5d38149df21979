"""The configuration of a node as a file: backup, comparison, and restore with a read-back of each object."""
