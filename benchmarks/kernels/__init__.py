"""Speed, memory and other processors."""
