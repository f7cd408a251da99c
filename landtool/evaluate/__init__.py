"""How good results are against the truth; metrics are pure functions of values."""
