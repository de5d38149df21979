"""The objects of the page: a node's dictionary, values read and written by SDO in a queue of the server, PDOs, findings."""
