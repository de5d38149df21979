"""Trying a module's gains with a step there and back: the trial, its measured response, and the manual's advice."""
