"""Reports about an EDS: display, comparison, export."""
