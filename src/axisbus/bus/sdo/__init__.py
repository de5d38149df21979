"""SDO on a channel: transfers in real time, channels, values with their types."""
