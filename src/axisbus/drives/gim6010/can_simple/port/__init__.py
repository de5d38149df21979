"""A CAN Simple module as a CiA 402 drive: a port for the motion code, a master on the wire; without any I/O."""
