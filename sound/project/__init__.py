"""What a sound project asks for, and the designs made from it, in files."""
