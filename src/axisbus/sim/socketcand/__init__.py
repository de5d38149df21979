"""A bus of stand-ins for other programs, served over TCP by the protocol of socketcand."""
