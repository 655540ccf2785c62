"""The film of orbit diagrams over the forcing frequency."""
