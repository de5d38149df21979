"""Common parts of procedures that move one module by messages, outside a cell: monitoring its heartbeat, removing its power."""
