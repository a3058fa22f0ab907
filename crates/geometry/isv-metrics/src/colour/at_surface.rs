//! Errors of colours at points of a surface.

use super::coloured::Coloured;
use super::psnr::psnr_db;
use crate::mean::mean;
use isv_volume::ycbcr_from_rgb;

/// Mean squared errors of Y, Cb and Cr at the points of a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ErrorsAtPoints([f64; 3]);

impl ErrorsAtPoints {
    /// Errors of the colours at the points of `from` against the colours that `to` has there.
    pub(super) fn new(from: &Coloured, to: &Coloured) -> Self {
        let there = to.colours_at(&from.points);
        Self([0, 1, 2].map(|channel| {
            let error =
                |i: usize| ycbcr_from_rgb(from.points[i].colour)[channel] - ycbcr_from_rgb(there[i])[channel];
            mean(there.len(), |i| error(i).powi(2))
        }))
    }

    pub(super) fn y_psnr_db(self) -> f64 {
        psnr_db(self.0[0])
    }

    /// PSNR of all three with six parts of Y, one of Cb and one of Cr.
    pub(super) fn ycc_psnr_db(self) -> f64 {
        let [y, cb, cr] = self.0;
        psnr_db((6.0 * y + cb + cr) / 8.0)
    }
}
