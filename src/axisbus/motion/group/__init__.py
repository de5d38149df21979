"""Groups of axes that move together: start barriers, their paths, and their motion along a path."""
