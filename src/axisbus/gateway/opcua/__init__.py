"""An OPC UA server beside a machine: pure tables of its variables and permissions, and a thin layer around asyncua."""
