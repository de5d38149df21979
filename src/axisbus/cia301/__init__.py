"""CiA 301 as tables and values: objects, data types, abort codes, EMCY, NMT and PDO mapping."""
