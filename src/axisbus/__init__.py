"""A CANopen CiA 402 master: named axes in engineering units, with EDS tools and a simulated drive."""

__version__ = "0.1.0"
