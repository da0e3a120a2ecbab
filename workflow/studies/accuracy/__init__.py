"""The study of discretisations against frequencies that no mesh made."""
