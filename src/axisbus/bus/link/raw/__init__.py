"""Send and receive SocketCAN frames directly through sockets, many with one call; and frames of other adapters by python-can."""
