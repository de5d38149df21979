"""What scenarios share: a line of stand-ins, programs of their own, nets that can be cut, and golden messages."""
