"""CiA 401, generic I/O modules: its objects, and what of them one named input or output is."""
