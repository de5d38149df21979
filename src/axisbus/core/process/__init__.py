"""The core in a process of its own: what runs there, and what stands for it in the program."""
