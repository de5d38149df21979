"""The scope of the page: signals of every cycle, in batches, for the pages that show them."""
