"""Feed-forward: what the drive's controllers are told of a motion before there is an error that would tell them."""
