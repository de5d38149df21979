"""Triggers of captures, from a text or a function: on axes, inputs, outputs or touch probes."""
