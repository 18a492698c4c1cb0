"""Real cars: drives that they recorded, the tires and steering identified from them, and how well a vehicle agrees."""
