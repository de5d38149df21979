"""Symptoms that a user observes when something is wrong: one page each, with the errors and codes that refer to it."""
