"""A simulated GIM6010-8 that speaks CAN Simple, written from the manual v2.2 and what owners measured, apart from every codec."""
