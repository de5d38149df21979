"""SDO on a channel: transfers in real time, values with their types."""
