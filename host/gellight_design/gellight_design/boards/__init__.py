"""Circuit boards to order: the flexible strip of the LEDs and a carrier for the controller."""
