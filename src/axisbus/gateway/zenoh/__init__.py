"""Connect a machine to a Zenoh network: state, events, commands under a lease, objects and history of one cell."""
