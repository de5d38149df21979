"""A module that speaks CAN Simple as a CiA 402 drive: towards motion a port, towards the wire a master, without any I/O."""
