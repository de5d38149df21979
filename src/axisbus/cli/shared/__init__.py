"""What the commands share: the bus and the nodes that are meant, options, output, words and the terminal."""
