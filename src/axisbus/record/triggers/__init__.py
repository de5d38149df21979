"""Moments that a capture may wait for: what a text or a function means, whether of axes, inputs, outputs or touch probes."""
