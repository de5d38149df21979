"""An OPC UA server beside a machine: pure tables of what it has and who may do what, and a thin shell around asyncua."""
