"""What the Python tests share: how they start commands and nodes, and what they feed them."""
