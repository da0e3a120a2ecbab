"""What forests are worth: other ways to train them, learning curves, and the time they take."""
