"""Boot-up of a module that speaks CAN Simple: its identity, its state, and its stop sequence."""
