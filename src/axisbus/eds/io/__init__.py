"""EDS and DCF files read and written: sections, lines, values."""
