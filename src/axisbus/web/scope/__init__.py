"""The scope of the page: signals of every cycle, in batches, for those pages that look at them."""
