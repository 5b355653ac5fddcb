"""From a film of two sticks to the angle between them, frame by frame, each with its uncertainty."""
