"""The values that the page shows, as plain values and texts."""
