"""Pictures of the ground from files on this machine: tiles, and images with a position."""
