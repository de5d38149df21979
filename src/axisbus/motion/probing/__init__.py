"""The touch probe of an axis (CiA 402-2, 60B8h to 60BDh): armed, polled, read and switched off by SDO."""
