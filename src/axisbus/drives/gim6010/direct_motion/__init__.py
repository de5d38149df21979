"""What all have in common that move one module by messages, outside a cell: its heartbeat, and how its power is taken away."""
