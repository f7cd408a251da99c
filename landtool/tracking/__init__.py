"""The platform over time: Kalman filter, tracks, and the drone's own motion."""
