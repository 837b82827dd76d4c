"""Other methods for finding left-out physics, on the same recordings and the same regressors."""
