"""A cell in virtual time: simulated drives without a bus."""
