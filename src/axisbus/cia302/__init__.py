"""CiA 302 as pure state machines: boot-up of a node, and download of its program."""
