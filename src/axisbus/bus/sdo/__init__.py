"""SDO on a channel: transfers in real time, additional SDO channels, values with their types."""
