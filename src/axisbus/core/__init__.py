"""The one owner of a bus: scan, links, boot's wiring, rescue and parting."""
