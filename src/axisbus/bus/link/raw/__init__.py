"""SocketCAN frames straight through its sockets, many by one call; and how a channel gives a frame to any other adapter."""
