"""A first cell file of what was found on a bus; everything that only the user knows is a comment to confirm."""
