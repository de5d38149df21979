"""The rules of ``axisbus eds check``: one table of their texts, and one small function for each."""
