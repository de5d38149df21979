"""The checks of the cyclic modes in a cell file."""
