"""CiA 305 (LSS) as pure dialogues: find and configure nodes that have no node-ID yet."""
