"""PDO of one drive: chosen, mapped, configured, sent and received."""
