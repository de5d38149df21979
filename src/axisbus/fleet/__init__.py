"""The machines of a plant, over the network that it has: what crosses, and what a program or a person holds of it."""
