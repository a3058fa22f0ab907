//! Units of input coordinates.

use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// The unit that a file's coordinates are in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unit {
    /// `m`
    #[default]
    Metre,
    /// `dm`
    Decimetre,
    /// `cm`
    Centimetre,
    /// `mm`
    Millimetre,
    /// `in`
    Inch,
    /// `ft`, the international foot
    Foot,
    /// `us-ft`, the survey foot of 1200 / 3937 m
    SurveyFoot,
}

/// A unit name that is none of those in [`Unit`].
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("unit `{}` is not one of m, dm, cm, mm, in, ft, us-ft", name.escape_debug())]
pub struct ParseUnitError {
    /// The name given.
    pub name: String,
}

impl Unit {
    /// All units, largest metric one first.
    pub const ALL: [Self; 7] = [
        Self::Metre,
        Self::Decimetre,
        Self::Centimetre,
        Self::Millimetre,
        Self::Inch,
        Self::Foot,
        Self::SurveyFoot,
    ];

    /// Metres in one of this unit.
    #[must_use]
    pub fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Decimetre => 0.1,
            Self::Centimetre => 0.01,
            Self::Millimetre => 0.001,
            Self::Inch => 0.0254,
            Self::Foot => 0.3048,
            Self::SurveyFoot => 1200.0 / 3937.0,
        }
    }

    /// The name users write: `m`, `dm`, `cm`, `mm`, `in`, `ft` or `us-ft`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Decimetre => "dm",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
            Self::Inch => "in",
            Self::Foot => "ft",
            Self::SurveyFoot => "us-ft",
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Unit {
    type Err = ParseUnitError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|unit| unit.name() == name)
            .ok_or_else(|| ParseUnitError { name: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_parse_back_to_their_unit() {
        for unit in Unit::ALL {
            assert_eq!(unit.to_string().parse(), Ok(unit));
        }
        assert_eq!(
            "yd".parse::<Unit>().unwrap_err().to_string(),
            "unit `yd` is not one of m, dm, cm, mm, in, ft, us-ft"
        );
    }

    #[test]
    fn a_metre_is_made_of_whole_units() {
        let in_a_metre =
            [1.0, 10.0, 100.0, 1000.0, 39.370_078_740_157_48, 3.280_839_895_013_123, 3937.0 / 1200.0];
        for (unit, count) in Unit::ALL.into_iter().zip(in_a_metre) {
            assert!((unit.metres() * count - 1.0).abs() < 1e-12, "{unit}");
        }
    }
}
