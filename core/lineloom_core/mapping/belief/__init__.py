"""What is believed of a site: constraints, verdicts, and the map that follows from them."""
