"""The rules of ``axisbus eds check``: one table of what they say, and one small function each."""
