"""CiA 305 (LSS) as pure dialogues: finding, naming and configuring nodes that have no node ID yet."""
