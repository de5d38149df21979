"""Tuning on the page: a step there and back that its page answers for, measured, and what was seen of it."""
