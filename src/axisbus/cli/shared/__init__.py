"""Shared parts of the commands: selection of bus and nodes, options, output, texts and the terminal."""
