"""One node on the bus: NMT, EMCY, events, its dictionary, and what a scan finds of it."""
