"""Running pure dialogues over a channel: what decides hands out requests, and is told what came."""
