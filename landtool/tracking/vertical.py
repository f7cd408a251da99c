"""The height of a pad in the reference frame and how fast it changes: a Kalman filter of two states."""

from __future__ import annotations

from dataclasses import dataclass

_ACCEL_DENSITY = 0.5  # m^2/s^3: a drone that brakes its descent, a deck in a swell
_FIRST_RATE_MPS = 3.0


@dataclass(frozen=True)
class Vertical:
    """z_m, rate_mps, and their covariance: variances of both and what they share."""

    z_m: float
    rate_mps: float
    z_variance: float
    shared: float
    rate_variance: float

    @classmethod
    def begun(cls, z_m: float, variance_m2: float) -> Vertical:
        """Return what is known after a first height."""
        return cls(z_m, 0.0, variance_m2, 0.0, _FIRST_RATE_MPS**2)

    def after(self, dt_s: float) -> Vertical:
        """Return what is known `dt_s` later."""
        # z' = z + v dt;  Q = q [[dt^3/3, dt^2/2], [dt^2/2, dt]]
        q = _ACCEL_DENSITY
        return Vertical(
            self.z_m + self.rate_mps * dt_s,
            self.rate_mps,
            self.z_variance + 2.0 * dt_s * self.shared + dt_s**2 * self.rate_variance + q * dt_s**3 / 3.0,
            self.shared + dt_s * self.rate_variance + q * dt_s**2 / 2.0,
            self.rate_variance + q * dt_s,
        )

    def measured(self, z_m: float, variance_m2: float) -> Vertical:
        """Return what is known after one more height."""
        # K = P H^T / S, x + K (z - x), P = (I - K H) P, with H = (1, 0)
        total = self.z_variance + variance_m2
        gain, rate_gain = self.z_variance / total, self.shared / total
        off = z_m - self.z_m
        return Vertical(
            self.z_m + gain * off,
            self.rate_mps + rate_gain * off,
            gain * variance_m2,
            (1.0 - gain) * self.shared,
            self.rate_variance - rate_gain * self.shared,
        )
