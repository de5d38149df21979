"""Scenes with two axes that carry one beam: their commands, their faults, and the promises of such a pair."""
