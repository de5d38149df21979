"""Read and write EDS and DCF files: sections, lines, values."""
