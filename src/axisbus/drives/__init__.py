"""What is particular to a make of drive: identity, fault tables, quirks."""
