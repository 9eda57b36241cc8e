"""What is told of a map to those who ask; nothing here changes it."""
