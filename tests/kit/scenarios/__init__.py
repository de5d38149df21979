"""What scenarios share: a line of simulated drives, programs of their own, nets that can be cut, and golden messages."""
