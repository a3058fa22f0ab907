//! Numbers with units.

use isv_take::{BitRate, Length};

/// Lengths and rates from plain numbers: `5.mm()`, `1.5.mbps()`.
pub trait Quantity: Sized {
    /// So many metres.
    #[must_use]
    fn m(self) -> Length;
    /// So many centimetres.
    #[must_use]
    fn cm(self) -> Length;
    /// So many millimetres.
    #[must_use]
    fn mm(self) -> Length;
    /// So many kilobits (1,000 bits) a second.
    #[must_use]
    fn kbps(self) -> BitRate;
    /// So many megabits (1,000,000 bits) a second.
    #[must_use]
    fn mbps(self) -> BitRate;
}

impl<T: Into<f64>> Quantity for T {
    fn m(self) -> Length {
        Length::from_metres(self.into())
    }

    fn cm(self) -> Length {
        Length::from_metres(self.into() / 1e2)
    }

    fn mm(self) -> Length {
        Length::from_metres(self.into() / 1e3)
    }

    fn kbps(self) -> BitRate {
        BitRate::from_bits_per_second(self.into() * 1e3)
    }

    fn mbps(self) -> BitRate {
        BitRate::from_bits_per_second(self.into() * 1e6)
    }
}
