"""CiA 302 as pure machines: boot-up of a node, and download of its program."""
