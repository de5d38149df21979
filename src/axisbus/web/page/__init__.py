"""The contents for the browser: the page, its style and its own script."""
