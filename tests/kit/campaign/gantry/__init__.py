"""Scenes with two axes that carry one beam: their commands, their mishaps, and what such a pair promises."""
