"""One node on the bus: NMT, EMCY, events, object dictionary, and the result of a scan."""
