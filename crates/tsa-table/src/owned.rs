//! A table that owns its numbers.

use crate::arc::{ArcSeries, Growth, Patch, Shape};
use crate::table::{Metadata, Table};

/// Name of the form in reports.
pub const FORM: &str = "arc-series";

/// The numbers of [`ArcSeries`].
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedSeries {
    /// How the arc grows.
    pub growth: Growth,
    /// Powers in every range of the load.
    pub shape: Shape,
    /// Ranges of the load, ascending.
    pub patches: Vec<Patch>,
    /// All coefficients.
    pub coefficients: Vec<f32>,
}

impl OwnedSeries {
    /// The numbers for lookups.
    pub fn series(&self) -> ArcSeries<'_> {
        let Self { growth, shape, patches, coefficients } = self;
        ArcSeries { growth: *growth, shape: *shape, patches, coefficients }
    }

    /// Its size in words.
    pub fn size(&self) -> String {
        format!("{} ranges of {:?} coefficients", self.patches.len(), self.shape)
    }

    /// Bytes of numbers.
    pub fn bytes(&self) -> usize {
        self.series().bytes()
    }
}

/// A table that owns its numbers.
#[derive(Clone, Debug)]
pub struct OwnedTable {
    /// Range, accuracy and origin.
    pub metadata: Metadata,
    /// The numbers.
    pub numbers: OwnedSeries,
    /// CRC-32, see [`Table::checksum`].
    pub crc: u32,
}

impl OwnedTable {
    /// The table as the firmware uses it.
    pub fn table(&self) -> Table<'_> {
        Table { metadata: self.metadata, series: self.numbers.series(), crc: self.crc }
    }
}
