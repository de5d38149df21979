"""Run the dialogues with GIM6010 modules (CAN Simple) over a channel."""
