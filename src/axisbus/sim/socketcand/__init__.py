"""A bus of simulated nodes for other programs, served over TCP with the socketcand protocol."""
