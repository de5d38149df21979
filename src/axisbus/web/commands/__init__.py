"""Requests of pages: parse them, check whether the page may make them, and carry them out."""
