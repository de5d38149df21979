"""The core, the only owner of a bus: scan, links, boot, rescue and node shutdown."""
