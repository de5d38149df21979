"""What is told of an EDS: shown, compared, exported."""
