"""The study of the worst single modes of coarse models, and of the errors expected of them."""
