"""CiA 401, generic I/O modules: its objects, and one named input or output of them."""
