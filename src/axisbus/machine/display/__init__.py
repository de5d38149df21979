"""Displays for users: a machine in a notebook, and its page in the browser."""
