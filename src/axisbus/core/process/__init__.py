"""The core in a process of its own: the server there, and the program's client for it."""
