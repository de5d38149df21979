"""EDS and DCF files: what they say, with line numbers."""
