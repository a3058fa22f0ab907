//! The tools of the profile, each of which can be left out to see what it gives.

use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Tools that an encoder uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tools {
    /// Prediction of blocks from their neighbours; without it, what is not predicted from the frame before is predicted by zero.
    pub spatial: bool,
    /// Vectors; without them, blocks are predicted from the same place.
    pub motion: bool,
    /// Merging with the vectors of neighbours and of the frame before; without it, vectors are new or zero.
    pub merging: bool,
    /// Levels by pursuit; without it, by rounding the coefficients.
    pub pursuit: bool,
    /// Weights that only the surface has; without them, every voxel counts the same.
    pub weights: bool,
    /// Guarding the signs of voxels away from the surface.
    pub signs: bool,
    /// The in-loop filter.
    pub filter: bool,
    /// Skip cells; without them, all blocks are coded again.
    pub skip: bool,
}

/// A name that no tool has.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("no tool is called {0:?}; there are {names}", names = Tools::NAMES.join(", "))]
pub struct UnknownTool(String);

impl Tools {
    /// All of them.
    pub const ALL: Self = Self {
        spatial: true,
        motion: true,
        merging: true,
        pursuit: true,
        weights: true,
        signs: true,
        filter: true,
        skip: true,
    };

    /// Their names.
    pub const NAMES: [&str; 8] =
        ["spatial", "motion", "merging", "pursuit", "weights", "signs", "filter", "still"];

    /// Without a tool.
    ///
    /// # Errors
    /// [`UnknownTool`] if there is none of this name.
    pub fn without(mut self, name: &str) -> Result<Self, UnknownTool> {
        let tool = match name {
            "spatial" => &mut self.spatial,
            "motion" => &mut self.motion,
            "merging" => &mut self.merging,
            "pursuit" => &mut self.pursuit,
            "weights" => &mut self.weights,
            "signs" => &mut self.signs,
            "filter" => &mut self.filter,
            "still" => &mut self.skip,
            _ => return Err(UnknownTool(name.to_owned())),
        };
        *tool = false;
        Ok(self)
    }
}

/// Names of the tools that are left out, with commas between them.
impl FromStr for Tools {
    type Err = UnknownTool;

    fn from_str(without: &str) -> Result<Self, UnknownTool> {
        without.split(',').filter(|name| !name.is_empty()).try_fold(Self::ALL, Self::without)
    }
}

impl fmt::Display for Tools {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { spatial, motion, merging, pursuit, weights, signs, filter, skip } = *self;
        let used = [spatial, motion, merging, pursuit, weights, signs, filter, skip];
        let without = Self::NAMES.into_iter().zip(used).filter(|(_, used)| !used).map(|(name, _)| name);
        f.write_str(&without.collect::<Vec<_>>().join(","))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tool_can_be_left_out_by_name() {
        for name in Tools::NAMES {
            let tools: Tools = name.parse().unwrap();
            assert_ne!(tools, Tools::ALL);
            assert_eq!(tools.to_string(), name);
        }
        assert_eq!("".parse(), Ok(Tools::ALL));
        assert!("motion,lights".parse::<Tools>().unwrap_err().to_string().contains("\"lights\""));
    }
}
